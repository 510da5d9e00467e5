/* Power as a sum of physical terms, and the correction of a small network. */
#include "acqd_model.h"

#if HAS_GREYBOX
#include "lanes.h"

#define T double
#define ZERO 0.0
#define BODY(name) name##_row
#include "rigid_body.h"

#define PADDED ((AXES + LANES - 1) / LANES * LANES) /* joints, filled up to whole vectors */

double greybox_power(memory_t *memory, const row_t *middle)
{
    double q[PADDED] = {0}, qd[PADDED] = {0}, qdd[AXES], sine[PADDED], cosine[PADDED], direction[PADDED];
    double rigid[AXES], now = 0.0;
    posture_t_row posture;
    const double on = BASE.brake < 0 ? 1.0 : middle->signal[BASE.brake < 0 ? 0 : BASE.brake];
    memcpy(q, middle->q, sizeof middle->q);
    central_differences(middle, qd, qdd);
    for (int k = 0; k < PADDED; k += LANES) {
        lanes_t s, c;
        lanes_sincos(lanes_from(q + k), &s, &c);
        lanes_to(s, sine + k);
        lanes_to(c, cosine + k);
        lanes_to(lanes_tanh(lanes_from(qd + k) / BASE.sign_speed), direction + k);
    }
    posture_of_row(sine, cosine, qd, qdd, &posture);
    joint_torque_row(&posture, BASE.inertial, rigid);
    for (int k = 0; k < AXES; k++) {
        const double friction = BASE.coulomb[k] * direction[k] + BASE.viscous[k] * qd[k];
        const double motor = rigid[k] + BASE.rotor[k] * qdd[k] + friction;
        const double magnitude = sqrt(motor * motor + SMALL_TORQUE * SMALL_TORQUE) - SMALL_TORQUE;
        now += BASE.gain * motor * qd[k] + BASE.copper[k] * motor * motor + BASE.conduction[k] * magnitude;
    }
    double power = lagged(&memory->base, on * now, BASE.lag_s, STEP_S) + BASE.standby;
    for (int k = 0; k < SIGNALS; k++)
        power += BASE.signal_weight[k] * middle->signal[k];
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
