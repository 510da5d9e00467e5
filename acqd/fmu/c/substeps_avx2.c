/* substep_lanes.h for processors with AVX2: four lanes in one register. */
#include "acqd_model.h"

#if TERMS
#include "lanes.h"
#include "switches.h"

#if LANES > 1 && defined(__x86_64__)
#if defined(__clang__)
#pragma clang attribute push(__attribute__((target("avx2"))), apply_to = function)
#else
#pragma GCC target("avx2")
#endif
#define SUBSTEP_POWERS substep_powers_avx2
#include "substep_lanes.h"
#if defined(__clang__)
#pragma clang attribute pop
#endif
#else
void substep_powers_avx2(const row_t *middle, const switches_t *s, const double *parameter, double *drives, double *load)
{
    substep_powers(middle, s, parameter, drives, load);
}
#endif
#endif
