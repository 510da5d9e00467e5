/* One row of motion in, power out. FMI knows nothing of models, models know nothing of FMI. */
#ifndef ACQD_MODEL_H
#define ACQD_MODEL_H

#include "model_parts.h"

#define WINDOW (2 * RADIUS + 1)
#define SUB 4 /* fine points a row: a meter averages over its window */

typedef struct {
    double q[AXES];            /* rad */
    double signal[SIGNALS + 1]; /* as SIGNAL_* in model_data.h numbers them; one more, as C has no empty arrays */
} row_t;

/* A first-order lag by the trapezoidal rule; at rest at the first value that it sees. */
typedef struct {
    double before, value;
    int begun;
} lag_t;

typedef struct {
    double last, points; /* 0/1 signal at the last fine point; fine points since it switched */
    int begun;
} switch_t;

/* What a model remembers from one row to the next. No pointers: a copy of its bytes is a copy of its state. */
typedef struct {
    double hidden[HIDDEN + 1], cell[HIDDEN + 1];
    lag_t base, load, drives;
    switch_t brake_opened, tool_switched;
} memory_t;

/* Power (W) of the middle row of a window of WINDOW rows; moves the memory on. */
double model_power(memory_t *memory, const double *parameter, const row_t *window);

/* The parts that it is made of. */
double network_power(memory_t *memory, const row_t *middle);
double greybox_power(memory_t *memory, const row_t *middle);
double perceptron_power(const row_t *middle);
double effects_power(memory_t *memory, const double *parameter, const row_t *middle);

double lagged(lag_t *lag, double value, double seconds, double step_s);
void central_differences(const row_t *middle, double *qd, double *qdd);

typedef struct {
    double at[3][3];
} frame_t;

/* How the links stand and move, in their own frames: what every torque of a rigid body needs. */
typedef struct {
    frame_t R[AXES]; /* to the parent's frame */
    double w[AXES][3], dw[AXES][3], dv[AXES][3];
} posture_t;

void posture_of(const double *q, const double *qd, const double *qdd, posture_t *posture);
/* Rigid-body torque [AXES] Nm of the links from `first` on with inertial parameters [][10], the others without mass
   (Luh, Walker, Paul 1980). */
void joint_torque(const posture_t *posture, const double (*links)[10], int first, double *tau);
/* Torque [AXES] Nm that holds 1 kg at a point of a link against gravity. */
void weight_torque(const double *q, int link, const double *point, double *tau);
double direction(double speed);
double magnitude(double torque);

#endif
