/* Samples at other instants: interpolation by a tabulated window of TAPS samples, as acqd/metering/quality/resample.py
   does it with numpy. The weights of an instant are made once, for all channels. */

#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "vectors.h"

#define TAPS 32
#define PARTS (TAPS / NATIVE)

INLINE native at(const double *x)
{
    native v;
    memcpy(&v, x, sizeof v);
    return v;
}

/* x [channels][samples] at `count` instants first + k * step, counted from the middle of sample 0, into out
   [channels][count]. table [steps + 2][TAPS]: weights of the fractions of a sample, linear in between. All samples that
   an instant needs must be there. */
void acqd_resample(const double *x, int64_t channels, int64_t samples, double first, double step, int64_t count,
                   const double *table, int64_t steps, double *out)
{
    for (int64_t k = 0; k < count; k++) {
        const double position = first + step * (double)k, whole = floor(position);
        const double fine = (position - whole) * (double)steps;
        const int64_t row = (int64_t)fine, begin = (int64_t)whole - (TAPS / 2 - 1);
        const double share = fine - (double)row;
        const double *low = table + row * TAPS, *high = low + TAPS;
        native weight[PARTS];
        for (int p = 0; p < PARTS; p++)
            weight[p] = at(low + NATIVE * p) * (1 - share) + at(high + NATIVE * p) * share;
        for (int64_t c = 0; c < channels; c++) {
            const double *from = x + c * samples + begin;
            native sum = {0};
            for (int p = 0; p < PARTS; p++)
                sum += at(from + NATIVE * p) * weight[p];
            double total = 0;
            for (int lane = 0; lane < NATIVE; lane++)
                total += sum[lane];
            out[c * count + k] = total;
        }
    }
}
