#include "instance.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define SLACK 1e-6 /* s: sums of a master's steps are not exact */

void state_begin(state_t *state)
{
    memset(state, 0, sizeof *state);
    for (int k = 0; k < SIGNALS; k++)
        state->value[FIRST_SIGNAL + k] = SIGNAL_START[k];
    for (int k = 0; k < PARAMETERS; k++)
        state->value[FIRST_PARAMETER + k] = PARAMETER_START[k];
}

static row_t inputs(const state_t *state)
{
    row_t row;
    memset(&row, 0, sizeof row);
    memcpy(row.q, state->value, sizeof row.q);
    for (int k = 0; k < SIGNALS; k++)
        row.signal[k] = state->value[FIRST_SIGNAL + k];
    return row;
}

static const double *parameters(const state_t *state) { return state->value + (PARAMETERS ? FIRST_PARAMETER : 0); }

void state_preview(state_t *state)
{
    row_t still[WINDOW];
    memory_t memory;
    memset(&memory, 0, sizeof memory);
    for (int k = 0; k < WINDOW; k++)
        still[k] = inputs(state);
    state->value[POWER] = model_power(&memory, parameters(state), still);
}

void state_start(state_t *state)
{
    state->time = state->start;
    state->rows_taken = state->since_reset = state->value[ENERGY] = 0.0;
    memset(&state->memory, 0, sizeof state->memory);
    state_preview(state);
}

static void take_row(state_t *state)
{
    const row_t row = inputs(state);
    if (state->reset != 0.0 || state->was_reset != 0.0)
        state->since_reset = state->was_reset = 0.0;
    if (state->since_reset == 0.0) {
        memset(&state->memory, 0, sizeof state->memory);
        state->value[ENERGY] = 0.0;
        for (int k = 0; k < WINDOW; k++)
            state->row[k] = row;
        state_preview(state);
    }
    memmove(state->row, state->row + 1, (WINDOW - 1) * sizeof(row_t));
    state->row[WINDOW - 1] = row;
    state->since_reset += 1.0;
    if (state->since_reset > RADIUS) {
        state->value[POWER] = model_power(&state->memory, parameters(state), state->row);
        state->value[ENERGY] += state->value[POWER] * STEP_S / 3.6e6;
    }
}

void state_step(state_t *state, double time, double seconds)
{
    const double end = time + seconds;
    if (state->reset != 0.0)
        state->was_reset = 1.0;
    while (state->start + state->rows_taken * STEP_S < end - SLACK) {
        take_row(state);
        state->rows_taken += 1.0;
    }
    state->time = end;
}

int state_keep(const state_t *state, void **kept)
{
    if (!*kept)
        *kept = malloc(sizeof *state);
    if (*kept)
        memcpy(*kept, state, sizeof *state);
    return *kept != 0;
}

typedef struct {
    char model[sizeof MODEL_TOKEN];
    unsigned int size;
    unsigned int check;
} seal_t;

static unsigned int checksum(const unsigned char *bytes, unsigned long size)
{
    unsigned int sum = 2166136261u; /* FNV-1a */
    for (unsigned long k = 0; k < size; k++)
        sum = (sum ^ bytes[k]) * 16777619u;
    return sum;
}

unsigned long state_bytes(void) { return sizeof(seal_t) + sizeof(state_t); }

void state_write(const state_t *state, unsigned char *bytes)
{
    seal_t seal;
    memset(&seal, 0, sizeof seal);
    memcpy(seal.model, MODEL_TOKEN, sizeof seal.model);
    seal.size = (unsigned int)sizeof *state;
    seal.check = checksum((const unsigned char *)state, sizeof *state);
    memcpy(bytes, &seal, sizeof seal);
    memcpy(bytes + sizeof seal, state, sizeof *state);
}

void *state_read(const unsigned char *bytes, unsigned long size)
{
    seal_t seal;
    if (size != state_bytes())
        return 0;
    memcpy(&seal, bytes, sizeof seal);
    if (memcmp(seal.model, MODEL_TOKEN, sizeof seal.model) != 0 || seal.size != sizeof(state_t) ||
        seal.check != checksum(bytes + sizeof seal, sizeof(state_t)))
        return 0;
    void *kept = malloc(sizeof(state_t));
    return kept ? memcpy(kept, bytes + sizeof seal, sizeof(state_t)) : 0;
}
