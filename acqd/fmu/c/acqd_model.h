/* A row of motion in, power out. FMI code knows nothing of models; model code knows nothing of FMI. */
#ifndef ACQD_MODEL_H
#define ACQD_MODEL_H

#include "model_parts.h"

#define WINDOW (2 * RADIUS + 1)
#define SUBSTEPS 4 /* points of motion per row: a meter averages over its window */

typedef struct {
    double q[AXES];            /* rad */
    double signal[SIGNALS + 1]; /* in the order of the inputs; one more, because C has no empty arrays */
} row_t;

/* A first-order lag by the trapezoidal rule, at rest at its first value. */
typedef struct {
    double before, value;
    int started;
} lag_t;

typedef struct {
    double last, substeps; /* 0/1 signal at the last substep; substeps since the last event */
    int started;
} switch_t;

/* The state of a model between rows. No pointers: a copy of the bytes is a copy of the state. */
typedef struct {
    double hidden[HIDDEN + 1], cell[HIDDEN + 1];
    lag_t base, load, drives;
    switch_t brake_opened, tool_switched;
} memory_t;

/* Power (W) of the middle row of a window of WINDOW rows; updates the memory. */
double model_power(memory_t *memory, const double *parameter, const row_t *window);

/* The parts of a model. */
double network_power(memory_t *memory, const row_t *middle);
double greybox_power(memory_t *memory, const row_t *middle);
double perceptron_power(const row_t *middle);
double effects_power(memory_t *memory, const double *parameter, const row_t *middle);

double lagged(lag_t *lag, double value, double seconds, double step_s);
void central_differences(const row_t *middle, double *qd, double *qdd);

#define GRAVITY 9.81
#define SMALL_TORQUE 0.5 /* Nm below which the magnitude of a torque is rounded off */

#endif
