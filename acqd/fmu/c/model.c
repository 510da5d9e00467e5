/* The model's parts together, and what they share. */
#include "acqd_model.h"

double lagged(lag_t *lag, double value, double seconds, double step_s)
{
    const double c = 2.0 * seconds / step_s;
    const double b = 1.0 / (1.0 + c);
    if (!lag->started) {
        lag->started = 1;
        lag->before = lag->value = value;
        return value;
    }
    lag->value = b * (value + lag->before) - (1.0 - c) * b * lag->value;
    lag->before = value;
    return lag->value;
}

void central_differences(const row_t *middle, double *qd, double *qdd)
{
    for (int k = 0; k < AXES; k++) {
        const double before = middle[-1].q[k], here = middle[0].q[k], after = middle[1].q[k];
        qd[k] = (after - before) / (2.0 * STEP_S);
        qdd[k] = (after - 2.0 * here + before) / (STEP_S * STEP_S);
    }
}

double model_power(memory_t *memory, const double *parameter, const row_t *window)
{
    const row_t *middle = window + RADIUS;
    double power = 0.0;
#if HAS_NETWORK
    power += network_power(memory, middle);
#endif
#if HAS_GREYBOX
    power += greybox_power(memory, middle);
#endif
#if HAS_PERCEPTRON
    power += perceptron_power(middle);
#endif
#if TERMS
    power += effects_power(memory, parameter, middle);
#endif
    (void)parameter;
    return power;
}
