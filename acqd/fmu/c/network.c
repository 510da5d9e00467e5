/* LSTM(10) behind manual features or convolution kernels, its affine head folded to one row (thesis appendix B). */
#include "acqd_model.h"

#if HAS_NETWORK
#include <math.h>

/* By one exponential each: twice as fast as the library's tanh, and as exact as a probability needs to be. */
static double sigmoid(double x) { return 1.0 / (1.0 + exp(-x)); }
static double squashed(double x) { return 1.0 - 2.0 / (1.0 + exp(2.0 * x)); }

static void features(const row_t *middle, double *x)
{
#if KERNELS
    /* every kernel sees every axis: maps in the order kernel, axis */
    double frame[KERNEL_LENGTH][AXES];
    for (int k = 0; k < KERNEL_LENGTH; k++)
        for (int axis = 0; axis < AXES; axis++)
            frame[k][axis] = (middle[k - KERNEL_LENGTH / 2].q[axis] - Q_OFFSET[0][axis]) / Q_SCALE[0][axis];
    for (int kernel = 0; kernel < KERNELS; kernel++) {
        double *map = x + kernel * AXES;
        for (int axis = 0; axis < AXES; axis++)
            map[axis] = KERNEL_BIAS[kernel];
        for (int k = 0; k < KERNEL_LENGTH; k++)
            for (int axis = 0; axis < AXES; axis++)
                map[axis] += KERNEL[kernel][k] * frame[k][axis];
    }
#else
    double moved[3][AXES];
    for (int axis = 0; axis < AXES; axis++)
        moved[0][axis] = middle->q[axis];
#if INPUT_ORDERS > 1
    central_differences(middle, moved[1], moved[2]);
#endif
    for (int order = 0; order < INPUT_ORDERS; order++)
        for (int axis = 0; axis < AXES; axis++)
            x[order * AXES + axis] = (moved[order][axis] - Q_OFFSET[order][axis]) / Q_SCALE[order][axis];
#endif
}

double network_power(memory_t *memory, const row_t *middle)
{
    double x[WIDTH], gate[4 * HIDDEN];
    features(middle, x);
    for (int k = 0; k < 4 * HIDDEN; k++)
        gate[k] = GATE_BIAS[k];
    for (int j = 0; j < WIDTH; j++) /* column by column: the compiler makes vectors of it */
        for (int k = 0; k < 4 * HIDDEN; k++)
            gate[k] += W_INPUT[j][k] * x[j];
    for (int j = 0; j < HIDDEN; j++)
        for (int k = 0; k < 4 * HIDDEN; k++)
            gate[k] += W_HIDDEN[j][k] * memory->hidden[j];
    double power = OUT_BIAS;
    for (int k = 0; k < HIDDEN; k++) {
        memory->cell[k] = sigmoid(gate[HIDDEN + k]) * memory->cell[k] + sigmoid(gate[k]) * squashed(gate[2 * HIDDEN + k]);
        memory->hidden[k] = sigmoid(gate[3 * HIDDEN + k]) * squashed(memory->cell[k]);
        power += OUT[k] * memory->hidden[k];
    }
    return power * P_SCALE + P_OFFSET;
}
#endif
