/* Physical effects that were added to a model, at SUB points a row: what acqd/models/effects has in numpy. */
#include "acqd_model.h"

#if TERMS
#include <math.h>

#define NEVER 1e30 /* fine points */

/* One fine point of motion. */
typedef struct {
    double q[AXES], qd[AXES], qdd[AXES];
    posture_t posture;
    double rigid[AXES], tau[AXES]; /* Nm of the body, and at the motors */
    double steer[AXES];            /* W per Nm more at the motors */
    double drives;                 /* W of motion, without standby */
    double on, brake, tool;        /* 0 or 1 */
    double brake_age, tool_age;    /* s since the brakes opened, the tool switched */
} point_t;

/* The value at a fine point of a signal that is on for a share of its row: it switches once within a row. */
static double fine(const row_t *middle, int signal, int point)
{
    const double before = middle[-1].signal[signal], share = middle[0].signal[signal], after = middle[1].signal[signal];
    const double place = (point + 0.5) / SUB;
    return after > before ? place > 1.0 - share : place < share;
}

static double loss(const grey_t *grey, int joint, double torque)
{
    return torque * torque * grey->copper[joint] + magnitude(torque) * grey->conduction[joint];
}

/* s since the signal rose (or switched at all, with `both`). */
static double age(switch_t *memory, double now, int both)
{
    const double change = memory->begun ? now - memory->last : 0.0;
    if (!memory->begun)
        memory->points = NEVER;
    memory->begun = 1;
    memory->last = now;
    memory->points = change > 0.5 || (both && change < -0.5) ? 0.0 : memory->points + 1.0;
    return memory->points * (STEP_S / SUB);
}

static void look(const row_t *middle, int number, memory_t *memory, point_t *p)
{
    const grey_t *grey = &CARRIER;
    p->brake = BRAKE < 0 ? 0.0 : fine(middle, BRAKE, number);
    p->tool = TOOL < 0 ? 0.0 : fine(middle, TOOL, number);
    p->on = grey->brake < 0 ? 1.0 : fine(middle, grey->brake, number);
    p->brake_age = BRAKE < 0 ? NEVER : age(&memory->brake_opened, p->brake, 0);
    p->tool_age = TOOL < 0 ? NEVER : age(&memory->tool_switched, p->tool, 1);
    for (int k = 0; k < AXES; k++) {
        p->q[k] = p->qd[k] = p->qdd[k] = 0.0;
        for (int node = 0; node < 5; node++) {
            const double q = middle[node - 2].q[k];
            p->q[k] += FINE[0][number][node] * q;
            p->qd[k] += FINE[1][number][node] * q;
            p->qdd[k] += FINE[2][number][node] * q;
        }
    }
    posture_of(p->q, p->qd, p->qdd, &p->posture);
    joint_torque(&p->posture, grey->inertial, 0, p->rigid);
    p->drives = 0.0;
    for (int k = 0; k < AXES; k++) {
        const double friction = grey->coulomb[k] * direction(p->qd[k]) + grey->viscous[k] * p->qd[k];
        p->tau[k] = p->on * (p->rigid[k] + grey->rotor[k] * p->qdd[k] + friction);
        p->rigid[k] *= p->on;
        const double rounded = sqrt(p->tau[k] * p->tau[k] + 0.25);
        p->steer[k] = p->on * (grey->gain * p->qd[k] + 2.0 * grey->copper[k] * p->tau[k] +
                               grey->conduction[k] * p->tau[k] / rounded);
        p->drives += grey->gain * p->tau[k] * p->qd[k] + loss(grey, k, p->tau[k]);
    }
}

/* Of a torque more at the motors, its square included; none while the brakes hold the arm. */
static double pulled(const point_t *p, const double *torque)
{
    const grey_t *grey = &CARRIER;
    double power = 0.0;
    for (int k = 0; k < AXES; k++)
        if (p->steer[k] != 0.0 && torque[k] != 0.0)
            power += grey->gain * p->qd[k] * torque[k] + loss(grey, k, p->tau[k] + torque[k]) - loss(grey, k, p->tau[k]);
    return power;
}

/* Torque of the effects that are one. `c` is W, Nm, kg ... per column, 0 where a term has none. */
static int torque_of(const term_t *term, const point_t *p, const double *c, double *torque)
{
    const double shape = term->shape[0];
    for (int k = 0; k < AXES; k++) {
        const double sign = direction(p->qd[k]), rate = p->qd[k] / (shape != 0.0 ? shape : 1.0);
        switch (term->effect) {
        case COULOMB_FRICTION: torque[k] = c[k] * sign; break;
        case VISCOUS_FRICTION: torque[k] = c[k] * p->qd[k]; break;
        case STRIBECK_FRICTION: torque[k] = c[k] * sign * exp(-rate * rate); break;
        case LOAD_DEPENDENT_FRICTION: torque[k] = c[k] * sign * fabs(p->rigid[k]); break;
        default: torque[k] = 0.0;
        }
    }
    if (term->effect == GEAR_RIPPLE) { /* shape: joint from 1, periods a turn */
        const int joint = (int)shape - 1;
        const double angle = term->shape[1] * p->q[joint];
        torque[joint] = c[0] * sin(angle) + c[1] * cos(angle);
    } else if (term->effect == PAYLOAD) { /* shape: centre of mass, m beyond the flange */
        double at[3];
        for (int i = 0; i < 3; i++)
            at[i] = TIP[0][i] + shape * TIP[1][i];
        const double m = c[0] + c[1] * p->tool, x = at[0], y = at[1], z = at[2];
        const double body[1][10] = {{m, m * x, m * y, m * z, m * (y * y + z * z), -m * x * y, m * (x * x + z * z),
                                     -m * x * z, -m * y * z, m * (x * x + y * y)}};
        joint_torque(&p->posture, body, AXES - 1, torque);
    } else if (term->effect == GRAVITY_BIAS) { /* columns: links from the second on */
        for (int link = 1; link < AXES; link++) {
            double held[AXES];
            if (c[link - 1] == 0.0)
                continue;
            weight_torque(p->q, link, LINK_CENTRE[link], held);
            for (int k = 0; k < AXES; k++)
                torque[k] += c[link - 1] * held[k];
        }
    }
    return term->effect <= LAST_TORQUE;
}

static double within(double age, const double *limit, int bins, const double *c)
{
    for (int k = 0; k < bins; k++)
        if (age >= limit[k] && age < limit[k + 1])
            return c[k];
    return 0.0;
}

/* W before the supply's lag. */
static double load_power(const term_t *term, const point_t *p, const double *c)
{
    static const double opened[] = {-0.02, 0.02, 0.06, 0.10, 0.16, 0.24, 0.36, 0.6};
    static const double switched[] = {-0.02, 0.1, 0.2, 0.4, 0.7};
    double torque[AXES], power = 0.0;
    if (torque_of(term, p, c, torque))
        return pulled(p, torque);
    switch (term->effect) {
    case MECHANICAL_POWER: /* lost in the gear; net; lost beside the motor */
        for (int k = 0; k < AXES; k++) {
            const double product = p->tau[k] * p->qd[k];
            power += c[k] * p->steer[k] * fabs(p->tau[k]) * direction(p->qd[k]);
            power += c[AXES + k] * product + c[2 * AXES + k] * fabs(product);
        }
        return power;
    case CONTACT_FORCE: /* shape: share of the time */
        weight_torque(p->q, AXES - 1, TIP[0], torque);
        for (int k = 0; k < AXES; k++)
            power -= p->steer[k] * torque[k] / 9.81;
        return c[0] * term->shape[0] * power;
    case COPPER_LOSS:
        for (int k = 0; k < AXES; k++)
            power += c[k] * p->tau[k] * p->tau[k];
        return power;
    case REGENERATION_CLIPPING: /* shape: above W */
        return c[0] * fmax(-p->drives - term->shape[0], 0.0);
    case SUPPLY_EFFICIENCY: { /* shape: standby on another supply */
        const double load = fmax(p->drives + CARRIER.standby * (1.0 - term->shape[0]), 0.0) / 100.0;
        return c[0] * load * load;
    }
    case BRAKE_RELEASE: return within(p->brake_age, opened, 7, c);
    case BRAKE_HOLDING: return c[0] * p->brake;
    case TOOL_ACTUATION: return c[0] * p->tool + within(p->tool_age, switched, 4, c + 1);
    case OFFSET_SHIFT: return c[0];
    case SWITCHING_LOAD: return c[0] * term->shape[0]; /* shape: share of the time */
    default: return 0.0;
    }
}

/* W as the meter sees it. */
static double meter_power(const term_t *term, double metered, double volts, const double *c)
{
    const double off = volts / 230.0 - 1.0;
    switch (term->effect) {
    case LINE_VOLTAGE: return off * (c[0] * metered + c[1]);
    case METER_GAIN: return c[0] * metered;
    case METER_SATURATION: return -c[0] * fmax(metered - term->shape[0] * CARRIER.standby, 0.0);
    default: return 0.0;
    }
}

double effects_power(memory_t *memory, const double *parameter, const row_t *middle)
{
    const grey_t *grey = &CARRIER;
    double coefficient[TERMS][COLUMNS], load = 0.0, metered = 0.0;
    for (int k = 0; k < TERMS; k++)
        for (int column = 0; column < COLUMNS; column++) {
            coefficient[k][column] = 0.0;
            for (int j = 0; j < TERM[k].parameters; j++)
                coefficient[k][column] += TERM[k].mix[column][j] * parameter[TERM[k].first_parameter + j];
        }
    for (int number = 0; number < SUB; number++) {
        point_t point;
        double power = 0.0;
        look(middle, number, memory, &point);
        for (int k = 0; k < TERMS; k++)
            power += load_power(&TERM[k], &point, coefficient[k]);
        load += lagged(&memory->load, power, grey->lag_s, STEP_S / SUB) / SUB;
        metered += lagged(&memory->drives, point.drives, grey->lag_s, STEP_S / SUB) / SUB;
    }
    metered += grey->standby;
    for (int k = 0; k < SIGNALS; k++)
        metered += grey->signal_weight[k] * middle->signal[k];
    for (int k = 0; k < TERMS; k++)
        load += meter_power(&TERM[k], metered, VOLTS < 0 ? 230.0 : middle->signal[VOLTS], coefficient[k]);
    return load;
}
#endif
