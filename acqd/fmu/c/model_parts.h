/* What the constants in model_data.h are made of. */
#ifndef ACQD_MODEL_PARTS_H
#define ACQD_MODEL_PARTS_H

#include "model_size.h"

/* A grey box: rigid body, rotors, friction, losses, supply; powers at the mains. */
typedef struct {
    double inertial[AXES][10]; /* mass, first moments, xx xy yy xz yz zz, per link */
    double rotor[AXES], coulomb[AXES], viscous[AXES], copper[AXES], conduction[AXES];
    double gain, lag_s, standby;
    double signal_weight[SIGNALS + 1];
    int brake; /* the signal that tells whether the drives carry the arm; -1: none */
} grey_t;

typedef enum {
    COULOMB_FRICTION, VISCOUS_FRICTION, STRIBECK_FRICTION, LOAD_DEPENDENT_FRICTION, THERMAL_FRICTION, GEAR_RIPPLE,
    PAYLOAD, GRAVITY_BIAS,
    LAST_TORQUE = GRAVITY_BIAS,
    MECHANICAL_POWER, CONTACT_FORCE, COPPER_LOSS, REGENERATION_CLIPPING, SUPPLY_EFFICIENCY, BRAKE_RELEASE,
    BRAKE_HOLDING, TOOL_ACTUATION, OFFSET_SHIFT, SWITCHING_LOAD, LINE_VOLTAGE, METER_GAIN, METER_SATURATION
} effect_t;

/* One added effect: its columns' coefficients are `mix` times its parameters. */
typedef struct {
    effect_t effect;
    double shape[2];
    int first_parameter, parameters;
    double mix[COLUMNS][TERM_PARAMETERS];
} term_t;

#include "model_data.h"

#endif
