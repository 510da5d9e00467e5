/* What is computed of samples besides the rows: for power quality and events samples at other instants, integrals over
   half cycles, phasors of cycles, the half cycles of a phase-locked loop; and whether samples are measurements. Each
   function does what a module of acqd/metering does with numpy, to rounding. Every buffer is the caller's. */

#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "vectors.h"

#define MOST_TAPS 32
#define GROUPS (LANES / NATIVE)
#define RESYNC 64

/* x [channels][samples] as rows [samples][LANES], the rest of them zero. */
INLINE void side_by_side(const double *x, int64_t channels, int64_t stride, int64_t samples, double *even)
{
    for (int64_t n = 0; n < samples; n++) {
        double *row = even + n * LANES; /* written at once: numbers in a row of its own are read before they have arrived */
        for (int64_t c = 0; c < channels; c++)
            row[c] = x[c * stride + n];
        for (int64_t c = channels; c < LANES; c++)
            row[c] = 0;
    }
}

/* One sample of a stream of `bits` per code. */
INLINE double code_at(const void *codes, int64_t bits, int64_t at)
{
    return bits == 16   ? (double)((const int16_t *)codes)[at]
           : bits == 32 ? (double)((const int32_t *)codes)[at]
                        : ((const double *)codes)[at];
}

INLINE void physical(const void *codes, const int64_t bits, int64_t channels, int64_t samples, const double *scale,
                     double *out)
{
    for (int64_t c = 0; c < channels; c++)
        for (int64_t n = 0; n < samples; n++)
            out[c * samples + n] = scale[c] * code_at(codes, bits, n * channels + c);
}

/* codes [samples][channels] in V and A: out [channels][samples]. scale [channels]. */
void acqd_physical(const void *codes, int64_t bits, int64_t channels, int64_t samples, const double *scale, double *out)
{
    if (bits == 16)
        physical(codes, 16, channels, samples, scale, out);
    else if (bits == 32)
        physical(codes, 32, channels, samples, scale, out);
    else
        physical(codes, 64, channels, samples, scale, out);
}

INLINE void mean_squares(const void *codes, const int64_t bits, int64_t phases, int64_t parts, int64_t length,
                         const double *scale, double *out)
{
    for (int64_t p = 0; p < phases; p++)
        for (int64_t k = 0; k < parts; k++) {
            double sum = 0;
            for (int64_t n = k * length; n < (k + 1) * length; n++) {
                const double u = scale[p] * code_at(codes, bits, n * 2 * phases + 2 * p);
                sum += u * u;
            }
            out[p * parts + k] = sum / (double)length;
        }
}

/* Mean squares of the voltages, channels 0, 2 .. of codes [parts * length][2 * phases], over `length` samples each:
   out [phases][parts]. scale [phases]. */
void acqd_mean_squares(const void *codes, int64_t bits, int64_t phases, int64_t parts, int64_t length,
                       const double *scale, double *out)
{
    if (bits == 16)
        mean_squares(codes, 16, phases, parts, length, scale, out);
    else if (bits == 32)
        mean_squares(codes, 32, phases, parts, length, scale, out);
    else
        mean_squares(codes, 64, phases, parts, length, scale, out);
}

/* Channels from `first` on of sample `n`, as many as a vector holds; what lies beyond the samples is not read. */
INLINE native row_of(const void *codes, const int64_t bits, int64_t channels, int64_t samples, int64_t n, int64_t first)
{
    const int64_t from = n * channels + first, end = samples * channels;
    if (from + NATIVE <= end)
        return native_load(codes, (int)bits, from);
    native x = {0};
    for (int64_t k = 0; from + k < end; k++)
        x[k] = code_at(codes, bits, from + k);
    return x;
}

INLINE void look(const void *codes, const int64_t bits, int64_t channels, int64_t samples, int64_t cycle, double *out)
{
    const int64_t whole = samples / cycle * cycle, half = whole ? cycle / 2 : 0;
    for (int64_t first = 0; first < channels; first += NATIVE) {
#define ROW(N) row_of(codes, bits, channels, samples, N, first)
        native low = ROW(0), high = low, before = low, step = {0}, sum = {0}, squares = {0}, sizes = {0}, sums = {0};
        native_mask lowest = {0}, highest = {0};
        for (int64_t n = 0; n < samples; n++) {
            const native x = ROW(n);
            low = native_smaller(low, x);
            high = native_larger(high, x);
            step = native_larger(step, native_larger(x - before, before - x));
            before = x;
            if (n >= whole)
                continue;
            sum += x;
            squares += x * x;
            sizes += native_larger(x, -x);
        }
        for (int64_t n = 0; n < samples; n++) {
            const native x = ROW(n);
            lowest -= (native_mask)(x == low);
            highest -= (native_mask)(x == high);
        }
        for (int64_t n = 0; n < half; n++) {
            const native x = ROW(n) + ROW(n + half);
            sums += native_larger(x, -x);
        }
#undef ROW
        for (int64_t lane = 0; lane < NATIVE && first + lane < channels; lane++) {
            const double row[9] = {low[lane], high[lane], step[lane], (double)lowest[lane], (double)highest[lane],
                                   sum[lane], squares[lane], sizes[lane], sums[lane]};
            for (int64_t k = 0; k < 9; k++)
                out[k * channels + first + lane] = row[k];
        }
    }
}

/* Of codes [samples][channels], at least one sample, of 16 or 32 bits: smallest, largest, largest step, samples that are
   the smallest, that are the largest; of the whole cycles sums of values, of squares, of magnitudes; and of the first
   cycle that of the magnitudes of sums of samples half a cycle apart: out [9][channels]. */
void acqd_look(const void *codes, int64_t bits, int64_t channels, int64_t samples, int64_t cycle, double *out)
{
    if (bits == 16)
        look(codes, 16, channels, samples, cycle, out);
    else
        look(codes, 32, channels, samples, cycle, out);
}

#define NOISE_POINTS 64
#define ENOUGH 256 /* samples that are counted: of more, every second one or fewer */

/* Median of `count` numbers, which are put in another order. (Hoare's selection.) */
static double median(double *x, int64_t count)
{
    const int64_t middle = count / 2;
    for (int64_t low = 0, high = count - 1; low < high;) {
        const double pivot = x[middle];
        int64_t i = low, j = high;
        while (i <= j) {
            while (x[i] < pivot)
                i++;
            while (x[j] > pivot)
                j--;
            if (i <= j) {
                const double y = x[i];
                x[i++] = x[j];
                x[j--] = y;
            }
        }
        if (j < middle)
            low = i;
        if (i > middle)
            high = j;
    }
    return x[middle];
}

/* Band of noise of a channel at its extremes: six standard deviations, from differences of the fourth order of some
   samples, at least two codes. */
INLINE double noise_band(const void *codes, const int64_t bits, int64_t channels, int64_t samples, int64_t channel)
{
    const int64_t points = samples - 4 < NOISE_POINTS ? samples - 4 : NOISE_POINTS;
    double sizes[NOISE_POINTS];
    for (int64_t k = 0; k < points; k++) {
        const int64_t from = k * (samples - 4) / points * channels + channel;
#define CODE(N) code_at(codes, bits, from + (N) * channels)
        sizes[k] = fabs(CODE(0) - 4 * CODE(1) + 6 * CODE(2) - 4 * CODE(3) + CODE(4));
#undef CODE
    }
    return fmax(6 / (0.6745 * sqrt(70.0)) * median(sizes, points), 2);
}

INLINE void tops(const void *codes, const int64_t bits, int64_t channels, int64_t samples, const double *least,
                 const double *most, double *out)
{
    const int64_t apart = samples / ENOUGH > 1 ? samples / ENOUGH : 1, counted = (samples + apart - 1) / apart;
    for (int64_t first = 0; first < channels; first += NATIVE) {
        native limits[2][3] = {{{0}}};
        native_mask counts[2][3] = {{{0}}};
        double bands[NATIVE] = {0};
        for (int64_t lane = 0; lane < NATIVE && first + lane < channels; lane++) {
            const double band = bands[lane] = noise_band(codes, bits, channels, samples, first + lane);
            for (int side = 0; side < 2; side++) {
                const double top = side ? -least[first + lane] : most[first + lane];
                limits[side][0][lane] = top - band;
                limits[side][1][lane] = top - 2 * band;
                limits[side][2][lane] = top / 2;
            }
        }
        for (int64_t n = 0; n < samples; n += apart) {
            const native x = row_of(codes, bits, channels, samples, n, first);
            for (int k = 0; k < 3; k++) {
                counts[0][k] -= (native_mask)(x > limits[0][k]);
                counts[1][k] -= (native_mask)(-x > limits[1][k]);
            }
        }
        for (int64_t lane = 0; lane < NATIVE && first + lane < channels; lane++) {
            out[first + lane] = 0;
            for (int side = 0; side < 2; side++) {
                const double top = side ? -least[first + lane] : most[first + lane];
                const int64_t near = counts[side][0][lane], next = counts[side][1][lane], half = counts[side][2][lane];
                if (20 * bands[lane] < 1.5 * top && near > 5 * (next - near + 1) && 20 * (half - next) > counted)
                    out[first + lane] = 1;
            }
        }
    }
}

/* Which channels of codes [samples][channels], at least five, of 16 or 32 bits, may have flat tops that noise blurs
   (blurred.py decides): many samples within the band of noise at an extreme, few in the next one. least, most
   [channels] are the extremes; out [channels] is 1 or 0. */
void acqd_tops(const void *codes, int64_t bits, int64_t channels, int64_t samples, const double *least,
               const double *most, double *out)
{
    if (bits == 16)
        tops(codes, 16, channels, samples, least, most, out);
    else
        tops(codes, 32, channels, samples, least, most, out);
}

/* Smallest and largest of codes [samples][channels] of each channel, and how many samples are the one or the other
   where they differ, else how many there are: out [3][channels]. */
INLINE void extremes(const void *codes, const int64_t bits, int64_t channels, int64_t samples, double *out)
{
    for (int64_t first = 0; first < channels; first += NATIVE) {
        native low = row_of(codes, bits, channels, samples, 0, first), high = low;
        native_mask count = {0};
        for (int64_t n = 1; n < samples; n++) {
            const native x = row_of(codes, bits, channels, samples, n, first);
            low = native_smaller(low, x);
            high = native_larger(high, x);
        }
        for (int64_t n = 0; n < samples; n++) {
            const native x = row_of(codes, bits, channels, samples, n, first);
            count -= (native_mask)(x == low) | (native_mask)(x == high);
        }
        for (int64_t lane = 0; lane < NATIVE && first + lane < channels; lane++) {
            out[first + lane] = low[lane];
            out[channels + first + lane] = high[lane];
            out[2 * channels + first + lane] = (double)count[lane];
        }
    }
}

/* How many of the `blocks` of codes, cut at the positions edges [blocks + 1], are no reason for a look (look.py): each
   begins before `due`, is shorter than three cycles, and has no channel with more samples at its extremes than most
   [channels], or near both ends of 16 bits. usual: times the share of a block that is no reason, what is left of that
   after the next, samples that are no reason, the end. out [3][channels] is scratch. */
int64_t acqd_calm(const void *codes, int64_t bits, int64_t channels, int64_t blocks, const int64_t *edges,
                  int64_t cycle, int64_t due, const double *usual, double *most, double *out)
{
    const double *low = out, *high = out + channels, *at_ends = out + 2 * channels;
    for (int64_t k = 0; k < blocks; k++) {
        const int64_t samples = edges[k + 1] - edges[k];
        if (samples < cycle)
            continue;
        if (edges[k] >= due || samples >= 3 * cycle)
            return k;
        const char *block = (const char *)codes + edges[k] * channels * (bits / 8);
        if (bits == 16)
            extremes(block, 16, channels, samples, out);
        else
            extremes(block, 32, channels, samples, out);
        double share[LANES];
        for (int64_t c = 0; c < channels; c++) {
            share[c] = at_ends[c] / (double)samples;
            if (share[c] > most[c] + usual[2] / (double)samples || (high[c] > usual[3] && low[c] < -usual[3]))
                return k;
        }
        for (int64_t c = 0; c < channels; c++)
            most[c] = fmax(usual[0] * share[c], usual[1] * most[c]);
    }
    return blocks;
}

INLINE void resample(const int taps, int64_t channels, double first, double step, int64_t count, const double *table,
                     int64_t steps, const double *even, double *out)
{
    for (int64_t k = 0; k < count; k++) {
        const double position = first + step * (double)k, whole = floor(position);
        const double fine = (position - whole) * (double)steps;
        const int64_t row = (int64_t)fine, begin = (int64_t)whole - (taps / 2 - 1);
        const double share = fine - (double)row;
        const double *low = table + row * taps, *high = low + taps, *from = even + begin * LANES;
        double weight[MOST_TAPS];
        for (int p = 0; p < taps / NATIVE; p++) {
            const native w = at(low + NATIVE * p) * (1 - share) + at(high + NATIVE * p) * share;
            memcpy(weight + NATIVE * p, &w, sizeof w);
        }
        double all[LANES];
#pragma GCC unroll 4
        for (int g = 0; g < GROUPS; g++) {
            const double *column = from + NATIVE * g;
            native a = {0}, b = {0}, c = {0}, d = {0}; /* four chains, since an addition takes four cycles */
#pragma GCC unroll 8
            for (int t = 0; t < taps; t += 4) {
                a += at(column + t * LANES) * weight[t];
                b += at(column + (t + 1) * LANES) * weight[t + 1];
                c += at(column + (t + 2) * LANES) * weight[t + 2];
                d += at(column + (t + 3) * LANES) * weight[t + 3];
            }
            const native s = (a + b) + (c + d);
            memcpy(all + NATIVE * g, &s, sizeof s);
        }
        for (int64_t c = 0; c < channels; c++)
            out[c * count + k] = all[c];
    }
}

/* x [channels][samples], rows `stride` apart, at `count` instants first + k * step, counted from the middle of sample 0,
   into out [channels][count]. table [steps + 2][taps]: weights of the fractions of a sample, linear in between; they are
   made once for all channels. 16 or 32 taps. All samples that an instant needs must be there. even [samples][LANES] is
   scratch. */
void acqd_resample(const double *x, int64_t channels, int64_t stride, int64_t samples, double first, double step,
                   int64_t count, const double *table, int64_t taps, int64_t steps, double *even, double *out)
{
    if (channels == 6)
        side_by_side(x, 6, stride, samples, even);
    else
        side_by_side(x, channels, stride, samples, even);
    if (taps == 16)
        resample(16, channels, first, step, count, table, steps, even, out);
    else
        resample(32, channels, first, step, count, table, steps, even, out);
}

/* Integral over the first share of a cell, by the straight line through its neighbours (interval.py). */
static double partial(const double *s, int64_t last, double position)
{
    const double cell = floor(position), share = position - cell;
    const int64_t n = (int64_t)cell, middle = n < last ? n : last;
    const double slope = (s[middle < last ? middle + 1 : last] - s[middle > 0 ? middle - 1 : 0]) / 2;
    return share * s[middle] + (share * share - share) / 2 * slope;
}

static double plain_sum(const double *s, int64_t begin, int64_t end)
{
    native sum = {0};
    int64_t n = begin;
    for (; n + NATIVE <= end; n += NATIVE)
        sum += at(s + n);
    double rest = total(sum);
    for (; n < end; n++)
        rest += s[n];
    return rest;
}

/* Integrals of s [samples] over the `count` intervals between start + k * length and the next such bound. */
static void integrals(const double *s, int64_t samples, double start, double length, int64_t count, double *out)
{
    double before = partial(s, samples - 1, start);
    int64_t begin = (int64_t)floor(start);
    for (int64_t k = 1; k <= count; k++) {
        const double bound = start + length * (double)k, after = partial(s, samples - 1, bound);
        const int64_t end = (int64_t)floor(bound);
        out[k - 1] = plain_sum(s, begin, end) - before + after;
        before = after;
        begin = end;
    }
}

static void squares(const double *a, const double *b, int64_t samples, double *s) /* of a - b */
{
    for (int64_t n = 0; n < samples; n++)
        s[n] = (a[n] - b[n]) * (a[n] - b[n]);
}

/* Smallest and largest of x [samples], at least one. */
static void range(const double *x, int64_t samples, double *smallest, double *largest)
{
    double low = x[0], high = x[0];
    int64_t n = 0;
    if (samples >= NATIVE) {
        native lows = at(x), highs = lows;
        for (n = NATIVE; n + NATIVE <= samples; n += NATIVE) {
            lows = native_smaller(lows, at(x + n));
            highs = native_larger(highs, at(x + n));
        }
        for (int lane = 0; lane < NATIVE; lane++) {
            low = lows[lane] < low ? lows[lane] : low;
            high = highs[lane] > high ? highs[lane] : high;
        }
    }
    for (; n < samples; n++) {
        low = x[n] < low ? x[n] : low;
        high = x[n] > high ? x[n] : high;
    }
    *smallest = low;
    *largest = high;
}

/* Integrals over `halves` half cycles of x [2 * phases][samples]: squares of the channels, products u i of the phases,
   squares of the voltages between lines (three, or one of two phases), and, of three phases, that of the sum of the
   currents: out [series][halves], in this order. extremes [2][channels]: smallest and largest value within the
   interval. scratch [samples]. */
void acqd_half_cycle_integrals(const double *x, int64_t phases, int64_t stride, int64_t samples, double start,
                               double half, int64_t halves, double *scratch, double *out, double *extremes)
{
    const int64_t channels = 2 * phases;
    const int64_t low = (int64_t)start, high = (int64_t)ceil(start + half * (double)halves);
    for (int64_t c = 0; c < channels; c++) {
        const double *row = x + c * stride;
        range(row + low, (high < samples ? high : samples) - low, extremes + c, extremes + channels + c);
        for (int64_t n = 0; n < samples; n++)
            scratch[n] = row[n] * row[n];
        integrals(scratch, samples, start, half, halves, out);
        out += halves;
    }
    for (int64_t p = 0; p < phases; p++) {
        const double *u = x + 2 * p * stride, *i = u + stride;
        for (int64_t n = 0; n < samples; n++)
            scratch[n] = u[n] * i[n];
        integrals(scratch, samples, start, half, halves, out);
        out += halves;
    }
    for (int64_t p = 0; p < (phases == 3 ? 3 : phases - 1); p++) {
        squares(x + 2 * p * stride, x + 2 * ((p + 1) % phases) * stride, samples, scratch);
        integrals(scratch, samples, start, half, halves, out);
        out += halves;
    }
    if (phases == 3) {
        const double *a = x + stride, *b = a + 2 * stride, *c = b + 2 * stride;
        for (int64_t n = 0; n < samples; n++)
            scratch[n] = (a[n] + b[n] + c[n]) * (a[n] + b[n] + c[n]);
        integrals(scratch, samples, start, half, halves, out);
    }
}

/* Cosine and sine of the fundamental over `samples`; it has `length` samples per cycle and angle 0 at `start`. */
static void carrier(double start, double length, int64_t samples, double *cosine, double *sine)
{
    const double turn = 2 * M_PI / length, c1 = cos(turn), s1 = sin(turn);
    double c = 0, s = 0;
    for (int64_t n = 0; n < samples; n++) {
        if (n % RESYNC == 0) {
            const double angle = turn * ((double)n + 0.5 - start);
            c = cos(angle);
            s = sin(angle);
        }
        cosine[n] = c;
        sine[n] = s;
        const double next = c * c1 - s * s1;
        s = s * c1 + c * s1;
        c = next;
    }
}

static double mean(const double *x, int64_t count)
{
    return plain_sum(x, 0, count) / (double)count;
}

/* Of u [phases][samples] over `cycles` cycles from `start` on, of `length` samples each: RMS phasors of every cycle,
   against a cosine that begins with the first, re and im [phases][cycles]; the angle of each cycle against the first
   one, unwrapped, all phases together, angles [cycles]; and the share of the AC power that the fundamental has.
   scratch [3][samples] and [cycles] more. */
void acqd_cycle_phasors(const double *u, int64_t phases, int64_t stride, int64_t samples, double start, double length,
                        int64_t cycles, double *scratch, double *phasors, double *angles, double *purity)
{
    double *cosine = scratch, *sine = scratch + samples, *series = sine + samples, *sums = series + samples;
    double fundamental = 0, alternating = 0;
    carrier(start, length, samples, cosine, sine);
    for (int64_t p = 0; p < phases; p++) {
        const double *row = u + p * stride;
        double *out = phasors + 2 * p * cycles;
        const double factor = sqrt(2) / length;
        for (int64_t n = 0; n < samples; n++)
            series[n] = row[n] * cosine[n];
        integrals(series, samples, start, length, cycles, sums);
        for (int64_t m = 0; m < cycles; m++)
            out[2 * m] = factor * sums[m];
        for (int64_t n = 0; n < samples; n++)
            series[n] = row[n] * sine[n];
        integrals(series, samples, start, length, cycles, sums);
        double squares = 0;
        for (int64_t m = 0; m < cycles; m++) {
            out[2 * m + 1] = -factor * sums[m];
            squares += out[2 * m] * out[2 * m] + out[2 * m + 1] * out[2 * m + 1];
        }
        fundamental += squares / (double)cycles;
        integrals(row, samples, start, length, cycles, sums);
        const double level = mean(sums, cycles) / length;
        for (int64_t n = 0; n < samples; n++)
            series[n] = row[n] * row[n];
        integrals(series, samples, start, length, cycles, sums);
        alternating += mean(sums, cycles) / length - level * level;
    }
    *purity = fundamental / (alternating > 1e-30 ? alternating : 1e-30);
    angles[0] = 0;
    for (int64_t m = 0; m + 1 < cycles; m++) {
        double x = 0, y = 0;
        for (int64_t p = 0; p < phases; p++) {
            const double *z = phasors + 2 * (p * cycles + m);
            x += z[0] * z[2] + z[1] * z[3];
            y += z[0] * z[3] - z[1] * z[2];
        }
        angles[m + 1] = angles[m] + atan2(y, x);
    }
}

/* Harmonic subgroups 1 .. 50, centred interharmonic subgroups 0 .. 49, [channels][50] each, and THDS [channels] of
   lines [channels][51 * cycles + 1], complex; NaN from the `known`-th on, which THDS leaves out (spectrum.py). */
void acqd_groups(const double *lines, int64_t channels, int64_t cycles, int64_t known, double *harmonics,
                 double *between, double *thds)
{
    enum { ORDERS = 50 };
    for (int64_t c = 0; c < channels; c++) {
        const double *row = lines + 2 * c * ((ORDERS + 1) * cycles + 1);
        double *h = harmonics + c * ORDERS, *ih = between + c * ORDERS, distortion = 0;
        for (int64_t n = 0; n < ORDERS; n++) {
            const double *x = row + 2 * n * cycles; /* lines n * cycles .. (n + 1) * cycles + 1 */
            double inner = 0, group = 0;
            for (int64_t k = 2; k < cycles - 1; k++)
                inner += x[2 * k] * x[2 * k] + x[2 * k + 1] * x[2 * k + 1];
            for (int64_t k = cycles - 1; k < cycles + 2; k++)
                group += x[2 * k] * x[2 * k] + x[2 * k + 1] * x[2 * k + 1];
            h[n] = n < known ? sqrt(group) : NAN;
            ih[n] = n < known ? sqrt(inner) : NAN;
            distortion += n > 0 && n < known ? group : 0;
        }
        thds[c] = h[0] > 0 ? 100 * sqrt(distortion) / h[0] : NAN;
    }
}

/* A phase-locked loop (cycle_clock.py); positions are sample numbers of the stream. */
struct clock {
    double nominal, half, next, amplitude, astray;
};

/* Its constants, as cycle_clock.py has them. */
struct rules {
    double pull, steer, jump, lost, range, purity, calm;
};

/* A running sum between two samples. */
static double between(const double *sum, double position)
{
    const int64_t k = (int64_t)position;
    return sum[k] + (position - (double)k) * (sum[k + 1] - sum[k]);
}

static double step(struct clock *clock, const struct rules *rules, double bound, double origin, const double *re,
                   const double *im, const double *power, double carrier)
{
    const double first = bound - 2 * clock->half - origin, last = bound - origin;
    if (first < 0)
        return clock->half;
    const double x = between(re, last) - between(re, first), y = between(im, last) - between(im, first);
    const double square = between(power, last) - between(power, first);
    const double amplitude = hypot(x, y), before = clock->amplitude;
    const double larger = amplitude > before ? amplitude : before;
    clock->amplitude = amplitude;
    if (!(square > 0 && 2 * amplitude * amplitude >= rules->purity * square * (last - first) &&
          fabs(amplitude - before) <= rules->calm * larger)) /* also of samples that are no numbers */
        return clock->half;
    const double theta = atan2(y, x) + carrier * (last - clock->half) + 1.5 * M_PI;
    double error = fmod(theta + M_PI / 2, M_PI);
    error = (error < 0 ? error + M_PI : error) - M_PI / 2;
    if (fabs(error) > rules->jump) {
        if (++clock->astray > rules->lost) {
            clock->astray = 0;
            clock->half = clock->nominal;
        }
    } else {
        const double most = clock->nominal * (1 + rules->range), least = clock->nominal / (1 + rules->range);
        const double half = clock->half * (1 - rules->steer * error / M_PI);
        clock->astray = 0;
        clock->half = half > most ? most : half < least ? least : half;
    }
    return clock->half * (1 - rules->pull * error / M_PI);
}

/* Up to a position, of the squares of u whose running sum is `power`; a cut cell by the line through its neighbours. */
static double energy(const double *power, const double *u, int64_t last, double position)
{
    const double cell = floor(position), share = position - cell;
    const int64_t n = (int64_t)cell, middle = n < last ? n : last;
    if (n < 0)
        return 0;
    const double above = u[middle < last ? middle + 1 : last], below = u[middle > 0 ? middle - 1 : 0];
    const double slope = (above * above - below * below) / 2;
    return power[n] + share * u[middle] * u[middle] + (share * share - share) / 2 * slope;
}

/* The half cycles of `phases` channels, each with a clock, that end before the last two of their `samples` codes of
   `bits`: codes [samples][phases]; the first sample is number `origin`. scale [phases]; turning [2][length]: cosine and
   sine of -carrier k. At most `most` values of a phase into out [phases][most][4]: begin, end, RMS of the cycle, mean
   square of its second half; their numbers into counts [phases]. scratch [4][samples + 1]. */
void acqd_half_cycles(struct clock *clocks, const struct rules *rules, const void *codes, int64_t bits, int64_t phases,
                      int64_t samples, const double *scale, double origin, double carrier, const double *turning,
                      int64_t length, double *scratch, double *out, int64_t most, int64_t *counts)
{
    const double *cosine = turning, *sine = turning + length;
    double *re = scratch, *im = re + samples + 1, *power = im + samples + 1, *u = power + samples + 1;
    re[0] = im[0] = power[0] = 0;
    for (int64_t p = 0; p < phases; p++) {
        struct clock *clock = clocks + p;
        double x = 0, y = 0, square = 0;
        for (int64_t n = 0; n < samples; n++) {
            const double now = scale[p] * code_at(codes, bits, n * phases + p);
            u[n] = now;
            re[n + 1] = x += now * cosine[n];
            im[n + 1] = y += now * sine[n];
            power[n + 1] = square += now * now;
        }
        const double end = origin + (double)(samples - 2);
        int64_t count = 0;
        while (clock->next < end && count < most) {
            const double start = clock->next - 2 * clock->half, stop = clock->next, middle = (start + stop) / 2;
            const double first = energy(power, u, samples - 1, start - origin);
            const double half = energy(power, u, samples - 1, middle - origin);
            const double last = energy(power, u, samples - 1, stop - origin);
            double *row = out + 4 * (p * most + count++);
            row[0] = start;
            row[1] = stop;
            row[2] = last > first ? sqrt((last - first) / (stop - start)) : 0;
            row[3] = last > half ? (last - half) / (stop - middle) : 0;
            clock->next += step(clock, rules, clock->next, origin, re, im, power, carrier);
        }
        counts[p] = count;
    }
}

/* A linear filter of at most 32 states, x' = A x + B u, y = C x + D u, as many channels at once as a vector holds:
   u [channels][samples] with rows `stride` apart into y [channels][samples]. A [order][order]; state [channels][order]
   goes on from call to call. */
void acqd_filter(const double *A, const double *B, const double *C, double D, int64_t order, double *state,
                 const double *u, int64_t channels, int64_t stride, int64_t samples, double *y)
{
    for (int64_t first = 0; first < channels; first += NATIVE) {
        const int64_t count = channels - first < NATIVE ? channels - first : NATIVE;
        native x[32], next[32];
        for (int64_t i = 0; i < order; i++) {
            x[i] = (native){0};
            for (int64_t c = 0; c < count; c++)
                x[i][c] = state[(first + c) * order + i];
        }
        for (int64_t n = 0; n < samples; n++) {
            double row[NATIVE] = {0};
            for (int64_t c = 0; c < count; c++)
                row[c] = u[(first + c) * stride + n];
            const native input = at(row);
            native output = D * input;
            for (int64_t i = 0; i < order; i++)
                output += C[i] * x[i];
            memcpy(row, &output, sizeof row);
            for (int64_t c = 0; c < count; c++)
                y[(first + c) * samples + n] = row[c];
            for (int64_t i = 0; i < order; i++) {
                const int64_t known = i + 2 < order ? i + 2 : order; /* sections in a row: nothing comes from later ones */
                native sum = B[i] * input;
                for (int64_t j = 0; j < known; j++)
                    sum += A[i * order + j] * x[j];
                next[i] = sum;
            }
            memcpy(x, next, (size_t)order * sizeof *x);
        }
        for (int64_t i = 0; i < order; i++)
            for (int64_t c = 0; c < count; c++)
                state[(first + c) * order + i] = x[i][c];
    }
}
