/* Types of the constants in model_data.h. */
#ifndef ACQD_MODEL_PARTS_H
#define ACQD_MODEL_PARTS_H

#include "model_size.h"

/* A grey box: rigid body, rotors, friction, losses, supply; powers at the mains. */
typedef struct {
    double inertial[AXES][10]; /* mass, first moments, xx xy yy xz yz zz, per link */
    double rotor[AXES], coulomb[AXES], viscous[AXES], copper[AXES], conduction[AXES];
    double gain, lag_s, standby, sign_speed;
    double signal_weight[SIGNALS + 1];
    int brake; /* index of the signal that releases the brakes; -1: the drives always carry the arm */
} grey_t;

#include "model_data.h"

#endif
