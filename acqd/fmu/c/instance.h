/* A model in time: inputs that hold, a clock of STEP_S, power and energy. FMI 2 and FMI 3 are thin coats over this. */
#ifndef ACQD_INSTANCE_H
#define ACQD_INSTANCE_H

#include "acqd_model.h"

/* Variables: inputs q (AXES), signals (SIGNALS); outputs power, energy; parameters of the effects. */
#define FIRST_SIGNAL AXES
#define POWER (AXES + SIGNALS)
#define ENERGY (POWER + 1)
#define FIRST_PARAMETER (ENERGY + 1)
#define LONGEST_STEP 1e7 /* s */
#define VARIABLES (FIRST_PARAMETER + PARAMETERS)

typedef enum { INSTANTIATED, INITIALIZING, STEPPING, TERMINATED } phase_t;

/* Everything that a step depends on; no pointers, so that its bytes are the serialised state. */
typedef struct {
    double value[VARIABLES];
    double start;      /* s, of the first row */
    double time;       /* s, where the last step ended */
    double rows_taken; /* since the start; a double, so that the bytes hold no padding */
    double since_reset; /* rows */
    double reset;      /* input: not 0 restarts with the next row */
    double was_reset;  /* it was so in a step in which no row began */
    double phase;      /* a phase_t: a master that asks for a state back asks for this, too */
    row_t row[WINDOW];
    memory_t memory;
} state_t;

void state_begin(state_t *state);
/* From the start time that lies in the state. */
void state_start(state_t *state);
/* What power is likely to be before the first row is through: the arm standing where it is. */
void state_preview(state_t *state);
/* Rows that start within [time, time + seconds) see the inputs as they are now. */
void state_step(state_t *state, double time, double seconds);

/* A copy for the master, in *kept if that is one already; 0: no memory. */
int state_keep(const state_t *state, void **kept);

unsigned long state_bytes(void);
void state_write(const state_t *state, unsigned char *bytes);
/* As state_keep; NULL when the bytes are of another model or damaged. */
void *state_read(const unsigned char *bytes, unsigned long size);

#endif
