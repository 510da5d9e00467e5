/* Added effects, whatever they are: signals at substeps, the power of all terms (substep_lanes.h), the supply's lag.
   The effects' C is in acqd/models/effects/catalogue. */
#include "acqd_model.h"

#if TERMS
#define SUBSTEP_POWERS substep_powers
#include "substep_lanes.h"

#define NEVER 1e30 /* substeps */

/* A signal at the substeps of a row, from the share of the row in which it is on: it switches once within a row. */
static void at_substeps(const row_t *middle, int signal, double *values)
{
    const double before = middle[-1].signal[signal], share = middle[0].signal[signal], after = middle[1].signal[signal];
    for (int k = 0; k < SUBSTEPS; k++) {
        const double place = (k + 0.5) / SUBSTEPS;
        values[k] = after > before ? place > 1.0 - share : place < share;
    }
}

/* s since the signal rose, or with `both` since it switched, at every substep. */
static void ages(switch_t *memory, const double *values, int both, double *age)
{
    for (int k = 0; k < SUBSTEPS; k++) {
        const double change = memory->started ? values[k] - memory->last : 0.0;
        if (!memory->started)
            memory->substeps = NEVER;
        memory->started = 1;
        memory->last = values[k];
        memory->substeps = change > 0.5 || (both && change < -0.5) ? 0.0 : memory->substeps + 1.0;
        age[k] = memory->substeps * (STEP_S / SUBSTEPS);
    }
}

static void switches_of(const row_t *middle, memory_t *memory, switches_t *s)
{
    for (int k = 0; k < SUBSTEPS; k++) {
        s->on[k] = 1.0;
        s->brake[k] = s->tool[k] = 0.0;
        s->brake_age[k] = s->tool_age[k] = NEVER;
    }
#if BRAKE >= 0
    at_substeps(middle, BRAKE, s->brake);
    ages(&memory->brake_opened, s->brake, 0, s->brake_age);
#endif
#if TOOL >= 0
    at_substeps(middle, TOOL, s->tool);
    ages(&memory->tool_switched, s->tool, 1, s->tool_age);
#endif
    if (CARRIER.brake >= 0)
        at_substeps(middle, CARRIER.brake, s->on);
    (void)memory, (void)middle, (void)at_substeps, (void)ages;
}

#if LANES > 1 && defined(__x86_64__)
#include <cpuid.h>

/* AVX2 with registers that the operating system saves. The answer is kept: a virtual machine traps the question. */
static int has_avx2(void)
{
    static int known = -1;
    if (known < 0) {
        unsigned a, b, c, d, low = 0, high;
        known = 0;
        if (__get_cpuid(1, &a, &b, &c, &d) && (c & bit_OSXSAVE) && (c & bit_AVX))
            __asm__("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
        if ((low & 6) == 6 && __get_cpuid_count(7, 0, &a, &b, &c, &d))
            known = (b & bit_AVX2) != 0;
    }
    return known;
}
#else
static int has_avx2(void) { return 0; }
#endif

double effects_power(memory_t *memory, const double *parameter, const row_t *middle)
{
    double drives[SUBSTEPS], load[SUBSTEPS], power = 0.0, predicted = 0.0;
    switches_t switches;
    switches_of(middle, memory, &switches);
    (has_avx2() ? substep_powers_avx2 : substep_powers)(middle, &switches, parameter, drives, load);
    for (int k = 0; k < SUBSTEPS; k++) {
        power += lagged(&memory->load, load[k], CARRIER.lag_s, STEP_S / SUBSTEPS) / SUBSTEPS;
        predicted += lagged(&memory->drives, drives[k], CARRIER.lag_s, STEP_S / SUBSTEPS) / SUBSTEPS;
    }
    predicted += CARRIER.standby;
    for (int k = 0; k < SIGNALS; k++)
        predicted += CARRIER.signal_weight[k] * middle->signal[k];
    return power + meter_terms(predicted, VOLTS < 0 ? 0.0 : middle->signal[VOLTS < 0 ? 0 : VOLTS], parameter);
}
#endif
