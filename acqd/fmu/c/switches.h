/* Switched signals at the substeps of a row, and the powers that substeps.c and substeps_avx2.c compute from them. */
#ifndef ACQD_SWITCHES_H
#define ACQD_SWITCHES_H

#include "acqd_model.h"

typedef struct {
    double on[SUBSTEPS]; /* 1 while the drives carry the arm */
    double brake[SUBSTEPS], tool[SUBSTEPS];
    double brake_age[SUBSTEPS], tool_age[SUBSTEPS]; /* s since the brakes opened, since the tool switched */
} switches_t;

/* W before the supply's lag, of the drives and of all terms, at every substep; `parameter` is the model's. */
void substep_powers(const row_t *middle, const switches_t *s, const double *parameter, double *drives, double *load);
void substep_powers_avx2(const row_t *middle, const switches_t *s, const double *parameter, double *drives, double *load);

#endif
