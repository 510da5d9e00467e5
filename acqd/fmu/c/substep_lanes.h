/* Power of the drives and of all added effects at the substeps of a row. This file is compiled twice: in substeps.c for
   every processor, in substeps_avx2.c for processors with AVX2. Both do the same operations in the same order, so that
   results do not depend on the processor. SUBSTEP_POWERS is the name of the compiled function. The effects themselves are
   in terms.h, which acqd/fmu/terms.py generates from `c_body` of the classes in acqd/models/effects/catalogue. */
#include "acqd_model.h"
#include "lanes.h"
#include "switches.h"

#define T lanes_t
#define ZERO lanes_of(0.0)
#define BODY(name) name##_lanes
#include "rigid_body.h"

/* Motion and powers at LANES substeps; names as in acqd/models/effects/scene.py. */
typedef struct {
    lanes_t q[AXES], qd[AXES], qdd[AXES];
    lanes_t direction[AXES]; /* sign of the speed, smooth through standstill */
    posture_t_lanes posture;
    lanes_t tau_rigid[AXES], tau[AXES]; /* Nm of the rigid body, and at the motors */
    lanes_t loss[AXES];                 /* W in motor and inverter */
    lanes_t power_per_torque[AXES];     /* W/Nm at the motors */
    lanes_t drives;                     /* W of motion, without standby */
    lanes_t on, brake, tool;            /* 0 or 1 */
    lanes_t brake_age, tool_age;        /* s since the brakes opened, since the tool switched */
} point_t;

INLINE lanes_t motor_loss(int joint, lanes_t torque)
{
    const lanes_t magnitude = lanes_sqrt(torque * torque + SMALL_TORQUE * SMALL_TORQUE) - SMALL_TORQUE;
    return torque * torque * CARRIER.copper[joint] + magnitude * CARRIER.conduction[joint];
}

/* W of additional torque at the motors, with its square; 0 while the brakes hold the arm. */
static inline void torque_power(const point_t *p, const lanes_t *torque, lanes_t *power)
{
    *power = ZERO;
    for (int k = 0; k < AXES; k++) {
        if (!lanes_any(torque[k] != 0.0)) /* most terms act on one joint */
            continue;
        const lanes_t more =
            CARRIER.gain * p->qd[k] * torque[k] + (motor_loss(k, p->tau[k] + torque[k]) - p->loss[k]);
        *power += lanes_choose(p->power_per_torque[k] != 0.0, more, ZERO);
    }
}

/* c[k] while the age lies between limit[k] and limit[k + 1], else 0. */
INLINE lanes_t bin_value(lanes_t age, const double *limit, int bins, const double *c)
{
    lanes_t value = ZERO;
    for (int k = 0; k < bins; k++)
        value = lanes_choose((age >= limit[k]) & (age < limit[k + 1]), lanes_of(c[k]), value);
    return value;
}

#include "terms.h"

static inline void look(const row_t *middle, const switches_t *s, int first, point_t *p)
{
    lanes_t sine[AXES], cosine[AXES];
    p->on = lanes_from(s->on + first);
    p->brake = lanes_from(s->brake + first);
    p->tool = lanes_from(s->tool + first);
    p->brake_age = lanes_from(s->brake_age + first);
    p->tool_age = lanes_from(s->tool_age + first);
    for (int k = 0; k < AXES; k++) {
        p->q[k] = p->qd[k] = p->qdd[k] = ZERO;
        for (int node = 0; node < 5; node++) {
            const double q = middle[node - 2].q[k];
            p->q[k] += lanes_from(SUBSTEP_WEIGHT[0][node] + first) * q;
            p->qd[k] += lanes_from(SUBSTEP_WEIGHT[1][node] + first) * q;
            p->qdd[k] += lanes_from(SUBSTEP_WEIGHT[2][node] + first) * q;
        }
        lanes_sincos(p->q[k], &sine[k], &cosine[k]);
        p->direction[k] = lanes_tanh(p->qd[k] / CARRIER.sign_speed);
    }
    posture_of_lanes(sine, cosine, p->qd, p->qdd, &p->posture);
    joint_torque_lanes(&p->posture, CARRIER.inertial, p->tau_rigid);
    p->drives = ZERO;
    for (int k = 0; k < AXES; k++) {
        const lanes_t friction = CARRIER.coulomb[k] * p->direction[k] + CARRIER.viscous[k] * p->qd[k];
        p->tau[k] = p->on * (p->tau_rigid[k] + CARRIER.rotor[k] * p->qdd[k] + friction);
        p->tau_rigid[k] *= p->on;
        const lanes_t rounded = lanes_sqrt(p->tau[k] * p->tau[k] + SMALL_TORQUE * SMALL_TORQUE);
        p->loss[k] = p->tau[k] * p->tau[k] * CARRIER.copper[k] + (rounded - SMALL_TORQUE) * CARRIER.conduction[k];
        p->power_per_torque[k] = p->on * (CARRIER.gain * p->qd[k] + 2.0 * CARRIER.copper[k] * p->tau[k] +
                                          CARRIER.conduction[k] * p->tau[k] / rounded);
        p->drives += CARRIER.gain * p->tau[k] * p->qd[k] + p->loss[k];
    }
}

void SUBSTEP_POWERS(const row_t *middle, const switches_t *s, const double *parameter, double *drives, double *load)
{
    for (int first = 0; first < SUBSTEPS; first += LANES) {
        point_t point;
        lanes_t power;
        look(middle, s, first, &point);
        lanes_to(point.drives, drives + first);
        load_terms(&point, parameter, &power);
        lanes_to(power, load + first);
    }
}
