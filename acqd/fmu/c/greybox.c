/* Power as a sum of physical terms, and what a small network has seen them get wrong. */
#include "acqd_model.h"

#if HAS_GREYBOX
double greybox_power(memory_t *memory, const row_t *middle)
{
    const grey_t *grey = &BASE;
    double qd[AXES], qdd[AXES], rigid[AXES], now = 0.0;
    posture_t posture;
    const double on = grey->brake < 0 ? 1.0 : middle->signal[grey->brake];
    central_differences(middle, qd, qdd);
    posture_of(middle->q, qd, qdd, &posture);
    joint_torque(&posture, grey->inertial, 0, rigid);
    for (int k = 0; k < AXES; k++) {
        const double friction = grey->coulomb[k] * direction(qd[k]) + grey->viscous[k] * qd[k];
        const double motor = rigid[k] + grey->rotor[k] * qdd[k] + friction;
        now += grey->gain * motor * qd[k] + grey->copper[k] * motor * motor + grey->conduction[k] * magnitude(motor);
    }
    double power = lagged(&memory->base, on * now, grey->lag_s, STEP_S) + grey->standby;
    for (int k = 0; k < SIGNALS; k++)
        power += grey->signal_weight[k] * middle->signal[k];
    return power;
}
#endif

#if HAS_PERCEPTRON
#include <math.h>

double perceptron_power(const row_t *middle)
{
    double moved[3][AXES], power = 0.0;
    for (int axis = 0; axis < AXES; axis++)
        moved[0][axis] = middle->q[axis];
    central_differences(middle, moved[1], moved[2]);
    for (int unit = 0; unit < PERCEPTRON_HIDDEN; unit++) {
        double sum = PERCEPTRON_BIAS[unit];
        for (int order = 0; order < 3; order++)
            for (int axis = 0; axis < AXES; axis++)
                sum += PERCEPTRON_W[unit][order * AXES + axis] * (moved[order][axis] - Q_OFFSET[order][axis]) /
                       Q_SCALE[order][axis];
        power += PERCEPTRON_OUT[unit] * tanh(sum);
    }
    return power;
}
#endif
