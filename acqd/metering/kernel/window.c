/* Quantities of a window of 1 to 3 phases: f, sums over whole cycles, energy, reactive power of the fundamentals.

   The same arithmetic as the numpy path (acqd/metering/meter.py), for windows without anything unusual: whatever
   is unusual (no history yet, f not credible, bent phase, dead mains, a trial frequency whose vectors are not there)
   ends the call before that window, and the caller takes over.

   Samples are interleaved: U1, I1, U2, I2 ... They are taken apart into channels piece by piece: a piece and the vectors
   of a trial for it, which all phases share, stay in the innermost cache. */

#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "vectors.h"

#define PHASES (CHANNELS / 2)
#define PHASORS 7
#define EDGES (2 * PHASORS)
#define LONGEST 256 /* samples of a piece */

enum { DONE, NO_HISTORY, NO_TRIAL, UNUSUAL };

struct form {
    int64_t bits, fit, fixed, first_point, few;
    double rate, cycles, grid, slack, f_low, f_high, trial_low, trial_high, purity, steady, code_max, code_min;
    double least_spread, most_spread, spreads, share, calm_share, calm; /* of the two fits, as `few`: Hz, Hz, 1 */
    double scale[LANES], dead[LANES / 2], bend[PHASORS * PHASORS];
};

struct state {
    double trial, last; /* Hz */
    double change, apart; /* Hz: of the two fits, as in acqd/metering/two_fits.py */
    int64_t known, follows, reason, point;
};

/* Vectors of a trial frequency, as kernel.py packs them: the number of pieces of the stretch, then a `struct piece` for
   each. From the next multiple of LANES on, the weights of the samples of each piece, in columns that are filled up with
   zeros to a multiple of LANES: for Re d, -Im d of the stretch, Re k, -Im k, cos, sin, and, in the cycles, Re c, -Im c,
   Re d, -Im d. Pieces end where a one-cycle phasor begins or ends, and where the two cycles begin. */
struct piece {
    double samples, in_cycles; /* whether c and d of the cycles have weights */
    double edge;               /* at its end: j: phasor j begins, PHASORS + j: phasor j ends; -1: neither */
    double cos, sin;           /* of the next sample, times the share of it that lies before the edge */
};
#define PADDED(n) (((n) + LANES - 1) / LANES * LANES)
#define OF_STRETCH 6
#define OF_CYCLES 4

/* Running sums: of the projection, where d is of the cycles, e of the stretch, k of a kink; of the voltages and of their
   squares. */
struct projection {
    native c[CHANNELS][2], d[PHASES][2], e[PHASES][2], k[PHASES][2], turn[PHASES][2], plain[PHASES], square[PHASES];
};

struct fit {
    double c[CHANNELS][2], d[PHASES][2], e[PHASES][2], k[PHASES][2]; /* Re, -Im */
    double ac; /* power of the voltages without their means */
};

/* Running sums of products, and extremes. Zero is between these: channels are filled up with zeros. */
struct products {
    native square[CHANNELS], cross[PHASES], most[CHANNELS], least[CHANNELS];
};

struct sums {
    double square[CHANNELS], cross[PHASES], most[CHANNELS], least[CHANNELS];
};

/* Samples of a piece by channels, with zeros behind. */
typedef double channels[CHANNELS][LONGEST + 2 * LANES];

INLINE double code_at(const void *codes, int bits, int64_t at)
{
    return bits == 16   ? (double)((const int16_t *)codes)[at]
           : bits == 32 ? (double)((const int32_t *)codes)[at]
                        : ((const double *)codes)[at];
}

INLINE void put(double *x, native v)
{
    memcpy(x, &v, sizeof v);
}

/* 2 * NATIVE samples of 16 bits: u and i of a phase are the halves of a number of 32 bits, which are shuffled. */
INLINE void take_apart_pairs(channels x, int64_t n, const int16_t *codes)
{
    const native_ints zero = {0}, width = zero + 2 * NATIVE;
    native_ints count = zero, all[3] = {zero, zero, zero};
    for (int k = 0; k < 2 * NATIVE; k++)
        count[k] = k;
    memcpy(all, codes, PHASES * sizeof *all);
#pragma GCC unroll 3
    for (int p = 0; p < PHASES; p++) {
        const native_ints place = count * PHASES + p, first = place < 2 * width;
        const native_ints two = __builtin_shuffle(all[0], all[1], place & first);
        const native_ints pairs = __builtin_shuffle(two, all[2], (count & first) | ((place - width) & ~first));
        const native_ints u = (native_ints)((native_uints)pairs << 16) >> 16, i = pairs >> 16;
        for (int half = 0; half < 2 * NATIVE; half += NATIVE) {
            put(x[2 * p] + n + half, native_load(&u, 32, half));
            put(x[2 * p + 1] + n + half, native_load(&i, 32, half));
        }
    }
}

/* Samples from .. to, at most LONGEST, of `samples`, by channels. */
INLINE void take_apart(channels x, const void *codes, int bits, int64_t samples, int64_t from, int64_t to)
{
    int64_t n = from;
#if __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
    if (bits == 16)
        for (; n < to && n + 2 * NATIVE <= samples; n += 2 * NATIVE)
            take_apart_pairs(x, n - from, (const int16_t *)codes + n * CHANNELS);
#endif
    for (; n < to; n++)
        for (int c = 0; c < CHANNELS; c++)
            x[c][n - from] = code_at(codes, bits, n * CHANNELS + c);
    for (int c = 0; c < CHANNELS; c++)
        for (int k = 0; k < LANES; k += NATIVE)
            put(x[c] + to - from + k, (native){0});
}

/* A piece into the projection; `weights` are its own. All that is summed up in a loop stays in registers. */
INLINE void project(struct projection *f, const channels x, int64_t samples, int in_cycles, const double *weights)
{
    const int64_t length = PADDED(samples);
    const double *cycles = weights + OF_STRETCH * length;
    for (int p = 0; p < PHASES; p++) {
        const double *u = x[2 * p], *i = x[2 * p + 1];
        native re_e = f->e[p][0], im_e = f->e[p][1], re_k = f->k[p][0], im_k = f->k[p][1];
        native cos = f->turn[p][0], sin = f->turn[p][1], plain = f->plain[p], square = f->square[p];
        for (int64_t n = 0; n < length; n += NATIVE) {
            const native v = at(u + n);
            const double *w = weights + n;
            re_e += v * at(w);
            im_e += v * at(w + length);
            re_k += v * at(w + 2 * length);
            im_k += v * at(w + 3 * length);
            cos += v * at(w + 4 * length);
            sin += v * at(w + 5 * length);
            plain += v;
            square += v * v;
        }
        f->e[p][0] = re_e, f->e[p][1] = im_e, f->k[p][0] = re_k, f->k[p][1] = im_k;
        f->turn[p][0] = cos, f->turn[p][1] = sin, f->plain[p] = plain, f->square[p] = square;
        if (!in_cycles)
            continue;
        native re_u = f->c[2 * p][0], im_u = f->c[2 * p][1], re_i = f->c[2 * p + 1][0], im_i = f->c[2 * p + 1][1];
        native re_d = f->d[p][0], im_d = f->d[p][1];
        for (int64_t n = 0; n < length; n += NATIVE) {
            const native v = at(u + n), a = at(i + n), re = at(cycles + n), im = at(cycles + length + n);
            re_u += v * re;
            im_u += v * im;
            re_i += a * re;
            im_i += a * im;
            re_d += v * at(cycles + 2 * length + n);
            im_d += v * at(cycles + 3 * length + n);
        }
        f->c[2 * p][0] = re_u, f->c[2 * p][1] = im_u, f->c[2 * p + 1][0] = re_i, f->c[2 * p + 1][1] = im_i;
        f->d[p][0] = re_d, f->d[p][1] = im_d;
    }
}

/* Samples from .. `samples` of a piece into the sums. */
INLINE void add_products(struct products *s, const channels x, int64_t from, int64_t samples)
{
    for (int p = 0; p < PHASES; p++) {
        const int c = 2 * p;
        native uu = s->square[c], ii = s->square[c + 1], ui = s->cross[p], high_u = s->most[c], low_u = s->least[c];
        native high_i = s->most[c + 1], low_i = s->least[c + 1];
        for (int64_t n = from; n < samples; n += NATIVE) {
            const native u = at(x[c] + n), i = at(x[c + 1] + n);
            uu += u * u;
            ii += i * i;
            ui += u * i;
            high_u = native_larger(u, high_u);
            low_u = native_smaller(u, low_u);
            high_i = native_larger(i, high_i);
            low_i = native_smaller(i, low_i);
        }
        s->square[c] = uu, s->square[c + 1] = ii, s->cross[p] = ui, s->most[c] = high_u, s->least[c] = low_u;
        s->most[c + 1] = high_i, s->least[c + 1] = low_i;
    }
}

INLINE struct sums totals(const struct products *s)
{
    struct sums all;
    for (int c = 0; c < CHANNELS; c++) {
        all.square[c] = total(s->square[c]);
        all.most[c] = all.least[c] = 0;
        for (int lane = 0; lane < NATIVE; lane++) {
            all.most[c] = fmax(all.most[c], s->most[c][lane]);
            all.least[c] = fmin(all.least[c], s->least[c][lane]);
        }
    }
    for (int p = 0; p < PHASES; p++)
        all.cross[p] = total(s->cross[p]);
    return all;
}

/* Sums over the samples from .. to. */
INLINE struct sums range_sums(const void *codes, int bits, int64_t samples, int64_t from, int64_t to)
{
    struct products s = {0};
    channels x;
    for (int64_t n = from; n < to; n += LONGEST) {
        const int64_t stop = n + LONGEST < to ? n + LONGEST : to;
        take_apart(x, codes, bits, samples, n, stop);
        add_products(&s, x, 0, stop - n);
    }
    return totals(&s);
}

/* What the one-cycle phasors say: distance of a phase from the parabola through all [rad], the largest; half of what
   ln(magnitude) varies by. What a step of f shortly before their end would move f by, and the same
   of ln(magnitude) [Hz]. */
struct cycles {
    double bend, swell, kink, growth;
};

static struct cycles cycles_of(double edges[EDGES][PHASES][2], const double *bend)
{
    double joint[PHASORS][2] = {{0}}, phase[PHASORS], largest = 0, least = INFINITY, most = 0;
    for (int p = 0; p < PHASES; p++) {
        double re[PHASORS], im[PHASORS], mean_re = 0, mean_im = 0;
        for (int j = 0; j < PHASORS; j++) {
            re[j] = edges[PHASORS + j][p][0] - edges[j][p][0];
            im[j] = edges[j][p][1] - edges[PHASORS + j][p][1];
            mean_re += re[j];
            mean_im += im[j];
        }
        for (int j = 0; j < PHASORS; j++) {
            joint[j][0] += mean_re * re[j] + mean_im * im[j];
            joint[j][1] += mean_re * im[j] - mean_im * re[j];
        }
    }
    for (int j = 0; j < PHASORS; j++) {
        const double square = joint[j][0] * joint[j][0] + joint[j][1] * joint[j][1];
        phase[j] = atan2(joint[j][1], joint[j][0]);
        least = fmin(least, square);
        most = fmax(most, square);
    }
    for (int j = 0; j < PHASORS; j++) {
        double rest = 0;
        for (int k = 0; k < PHASORS; k++)
            rest += phase[k] * bend[k * PHASORS + j];
        largest = fmax(largest, fabs(rest));
    }
    return (struct cycles){largest, log(most / fmax(least, 1e-300)) / 4, 0, 0};
}

/* f from that of the cycles and that of the stretch, and what the next window needs (acqd/metering/two_fits.py). */
static double joint(const struct form *form, struct state *s, double cycles, double stretch)
{
    const double x = cycles - stretch;
    double spread = form->most_spread;
    if (s->known)
        spread = fmin(fmax(form->spreads * s->change, form->least_spread), form->most_spread);
    const double fourth = (x * x) * (x * x), noise = (spread * spread) * (spread * spread);
    if (s->follows) {
        s->known = s->known < form->few ? s->known + 1 : form->few;
        s->change += (fmin(fabs(x - s->apart), form->most_spread) - s->change) / (double)s->known;
    }
    s->apart = x;
    s->follows = 1;
    const double calm = spread / form->calm;
    const double share = form->share + (form->calm_share - form->share) / (1 + calm * calm);
    return stretch + x * (share + (1 - share) * (fourth / (fourth + noise)));
}

/* One pass over the `samples` samples of the stretch: their projection, integrals of cos and sin up to each edge, and,
   where `window` is not NULL, the sums from sample `inside` on. */
INLINE struct fit pass(const double *trial, const void *codes, int bits, int64_t samples, int64_t inside,
                       double edges[EDGES][PHASES][2], struct sums *window)
{
    const int64_t count = (int64_t)trial[0];
    const struct piece *pieces = (const struct piece *)(trial + 1);
    const double *weights = trial + PADDED(1 + count * (int64_t)(sizeof *pieces / sizeof *trial));
    struct projection f = {0};
    struct products products = {0};
    channels x;
    int64_t n = 0;
    for (const struct piece *piece = pieces; piece < pieces + count; piece++) {
        const int64_t length = (int64_t)piece->samples, end = n + length;
        if (length) {
            take_apart(x, codes, bits, samples, n, end);
            project(&f, x, length, piece->in_cycles != 0, weights);
            weights += PADDED(length) * (piece->in_cycles ? OF_STRETCH + OF_CYCLES : OF_STRETCH);
            if (window && end > inside)
                add_products(&products, x, n < inside ? inside - n : 0, length);
            n = end;
        }
        if (piece->edge < 0)
            continue;
        for (int p = 0; p < PHASES; p++) {
            const double next = n < samples ? code_at(codes, bits, n * CHANNELS + 2 * p) : 0;
            edges[(int)piece->edge][p][0] = total(f.turn[p][0]) + next * piece->cos;
            edges[(int)piece->edge][p][1] = total(f.turn[p][1]) + next * piece->sin;
        }
    }
    if (window)
        *window = totals(&products);
    struct fit fit = {0};
    for (int part = 0; part < 2; part++) {
        for (int c = 0; c < CHANNELS; c++)
            fit.c[c][part] = total(f.c[c][part]);
        for (int p = 0; p < PHASES; p++) {
            fit.d[p][part] = total(f.d[p][part]);
            fit.e[p][part] = total(f.e[p][part]);
            fit.k[p][part] = total(f.k[p][part]);
        }
    }
    for (int p = 0; p < PHASES; p++) {
        const double plain = total(f.plain[p]), size = (double)samples;
        fit.ac += total(f.square[p]) / size - plain * plain / (size * size);
    }
    return fit;
}

/* Im(conj(c) z) of Re, -Im each. */
INLINE double turn(const double c[2], const double z[2])
{
    return c[1] * z[0] - c[0] * z[1];
}

/* f [Hz], the projection of the stretch and the sums of the window, which begins with its sample `inside`; 0 with the
   reason in `state` where f is not usable. */
INLINE double frequency(const struct form *form, struct state *state, struct fit *fit, struct sums *window,
                        const void *codes, int bits, int64_t inside, const double *const *table, struct cycles *cycles)
{
    double f = state->trial, edges[EDGES][PHASES][2];
    for (int step = 0; step < 4; step++) {
        const int64_t point = (int64_t)rint(fmin(fmax(f, form->trial_low), form->trial_high) / form->grid);
        const double *trial = table[point - form->first_point];
        if (!trial) {
            state->reason = NO_TRIAL;
            state->point = point;
            return 0;
        }
        *fit = pass(trial, codes, bits, form->fit, inside, edges, step ? NULL : window);
        double turns = 0, slow_turns = 0, late_turns = 0, growths = 0, weights = 0;
        for (int p = 0; p < PHASES; p++) {
            const double *c = fit->c[2 * p];
            turns += turn(c, fit->d[p]);
            slow_turns += turn(c, fit->e[p]);
            late_turns += turn(c, fit->k[p]);
            growths += c[0] * fit->k[p][0] + c[1] * fit->k[p][1];
            weights += c[0] * c[0] + c[1] * c[1];
        }
        const double turned = 2 * M_PI * fmax(weights, 1e-30);
        f = (double)point * form->grid + turns / turned;
        if (fabs(f - (double)point * form->grid) > form->slack * form->grid)
            continue;
        const int credible = f >= form->f_low && f <= form->f_high && weights / 2 >= form->purity * fmax(fit->ac, 1e-30);
        if (!credible)
            break;
        *cycles = cycles_of(edges, form->bend);
        cycles->kink = fabs(late_turns) / fmax(weights, 1e-30);
        cycles->growth = fabs(growths) / fmax(weights, 1e-30);
        if (cycles->bend > form->steady)
            break;
        return joint(form, state, f, (double)point * form->grid + slow_turns / turned);
    }
    state->reason = UNUSUAL;
    return 0;
}

/* Adds `sign` times the sums over the samples from .. to. */
INLINE void add_range(struct sums *out, double sign, const void *codes, int bits, int64_t samples, int64_t from,
                      int64_t to)
{
    if (from >= to)
        return;
    const struct sums range = range_sums(codes, bits, samples, from, to);
    for (int c = 0; c < CHANNELS; c++)
        out->square[c] += sign * range.square[c];
    for (int p = 0; p < PHASES; p++)
        out->cross[p] += sign * range.cross[p];
}

/* Adds `sign` times the integral of squares and products over the first `share` of a cell: the straight line through its
   neighbours. */
INLINE void add_part(struct sums *out, const void *codes, int bits, int64_t samples, int64_t cell, double share,
                     double sign)
{
    const int64_t last = samples - 1, here = cell < last ? cell : last;
    const int64_t next = here < last ? here + 1 : last, before = here > 0 ? here - 1 : 0;
    const double bow = (share * share - share) / 4;
    for (int c = 0; c < CHANNELS; c++) {
        const double x = code_at(codes, bits, here * CHANNELS + c), y = code_at(codes, bits, next * CHANNELS + c);
        const double z = code_at(codes, bits, before * CHANNELS + c);
        out->square[c] += sign * (share * (x * x) + bow * (y * y - z * z));
        if (c % 2)
            continue;
        const double a = code_at(codes, bits, here * CHANNELS + c + 1);
        const double b = code_at(codes, bits, next * CHANNELS + c + 1);
        const double d = code_at(codes, bits, before * CHANNELS + c + 1);
        out->cross[c / 2] += sign * (share * (x * a) + bow * (y * b - z * d));
    }
}

/* Sums over the interval start .. stop, which ends in the window, from those over the window. Sums of integer codes are
   exact: what is added and taken away again leaves nothing. */
INLINE struct sums interval(struct sums window, const void *codes, int bits, int64_t begin, int64_t end, double start,
                            double stop)
{
    const int64_t a = (int64_t)floor(start), b = (int64_t)floor(stop);
    add_range(&window, -1, codes, bits, end, begin, a);
    add_range(&window, 1, codes, bits, end, a, begin);
    add_range(&window, -1, codes, bits, end, b, end);
    add_part(&window, codes, bits, end, a, start - (double)a, -1);
    add_part(&window, codes, bits, end, b, stop - (double)b, 1);
    return window;
}

/* Rows of the result, each with one value per window; from FIRST on, each quantity has one row per phase. */
enum { F, FLAGS, MAGNITUDE, BEND, SWELL, KINK, GROWTH, FIRST };
enum { ENERGY, VRMS, IRMS, POWER, REACTIVE };
#define ROW(quantity, phase) (FIRST + (quantity) * PHASES + (phase))

INLINE int64_t marks_of(const struct form *form, const struct sums *s, int phase)
{
    for (int c = 2 * phase; c < 2 * phase + 2; c++)
        if (s->most[c] >= form->code_max || s->least[c] <= form->code_min)
            return (int64_t)16 << phase;
    return 0;
}

INLINE int one_window(const struct form *form, struct state *state, const double *const *table, const void *codes,
                      int bits, int64_t begin, int64_t end, double *out, int64_t stride)
{
    struct fit fit;
    struct sums window;
    struct state next = *state;
    if (end < form->fit)
        return (int)(state->reason = NO_HISTORY);
    const size_t width = bits == 16 ? 2 : bits == 32 ? 4 : 8;
    const char *stretch = (const char *)codes + (size_t)(end - form->fit) * CHANNELS * width;
    const int64_t inside = begin - (end - form->fit);
    struct cycles cycles = {0};
    const double f = frequency(form, &next, &fit, &window, stretch, bits, inside, table, &cycles);
    state->point = next.point;
    if (!f)
        return (int)(state->reason = next.reason);
    const double size = (double)(end - begin);
    /* Positions in the stretch: they must not be rounded otherwise where the window lies elsewhere in the buffer. */
    double length = form->fixed ? size : form->cycles * form->rate / f, start = (double)inside;
    if (!form->fixed)
        start = size >= length ? (double)inside + (size - length) / 2 : (double)form->fit - length;
    if (start < 0)
        return (int)(state->reason = NO_HISTORY);
    const double stop = fmin(start + length, (double)form->fit);
    const struct sums inner = interval(window, stretch, bits, inside, form->fit, start, stop);
    length = stop - start;
    int64_t flags = 0, live = 0;
    double magnitude = 0;
    for (int phase = 0; phase < PHASES; phase++) {
        const int c = 2 * phase;
        const double u = form->scale[c], i = form->scale[c + 1];
        const double volts = sqrt(fmax(inner.square[c] / length, 0)) * u;
        magnitude += fit.c[c][0] * fit.c[c][0] + fit.c[c][1] * fit.c[c][1];
        out[ROW(VRMS, phase) * stride] = volts;
        out[ROW(IRMS, phase) * stride] = sqrt(fmax(inner.square[c + 1] / length, 0)) * i;
        out[ROW(POWER, phase) * stride] = inner.cross[phase] / length * (u * i);
        out[ROW(REACTIVE, phase) * stride] = turn(fit.c[c + 1], fit.c[c]) * (u * i) / 2;
        out[ROW(ENERGY, phase) * stride] = window.cross[phase];
        if (volts > form->dead[phase])
            live++;
        else
            flags |= (int64_t)1 << phase;
        flags |= marks_of(form, &window, phase);
    }
    if (!live)
        return (int)(state->reason = UNUSUAL);
    out[F * stride] = f;
    out[FLAGS * stride] = (double)flags;
    out[MAGNITUDE * stride] = sqrt(magnitude);
    out[BEND * stride] = cycles.bend;
    out[SWELL * stride] = cycles.swell;
    out[KINK * stride] = cycles.kink;
    out[GROWTH * stride] = cycles.growth;
    next.trial = f;
    next.last = f;
    next.reason = DONE;
    *state = next;
    return DONE;
}

/* Meters windows bounds[k] .. bounds[k + 1] of the samples at `codes`; returns how many. Fewer than `windows`:
   state->reason. Compiled once per number of channels (-DCHANNELS=6). */
#define METER(BITS)                                                                                                    \
    while (done < windows                                                                                              \
           && one_window(form, state, table, codes, BITS, bounds[done], bounds[done + 1], out + done, windows)         \
              == DONE)                                                                                                \
        done++;

int64_t acqd_windows(const struct form *form, struct state *state, const double *const *table, const void *codes,
                     const int64_t *bounds, int64_t windows, double *out)
{
    int64_t done = 0;
    state->reason = DONE;
    if (form->bits == 16) {
        METER(16)
    } else if (form->bits == 32) {
        METER(32)
    } else {
        METER(64)
    }
    return done;
}

/* What the windows of a running stream have in common; the samples lie in a buffer that stays where it is. */
struct live {
    const struct form *form;
    struct state *state;
    const double *const *table;
    const void *codes;
    double *out;
    int64_t bounds[2]; /* of the next window, in samples of `codes` */
    struct state before; /* the state before it */
};

/* The next window of a running stream; whether it was metered. */
int64_t acqd_window(struct live *live)
{
    live->before = *live->state;
    return acqd_windows(live->form, live->state, live->table, live->codes, live->bounds, 1, live->out);
}

/* As if that window had not been metered. */
void acqd_undo(struct live *live)
{
    *live->state = live->before;
}

/* A window in which no voltage is mains: sums over exactly its samples, and no f. 0 where a voltage may be mains, or a
   code is at its end stop. */
INLINE int quiet(const struct form *form, const void *codes, int bits, int64_t begin, int64_t end, double *out)
{
    const struct sums s = range_sums(codes, bits, end, begin, end);
    const double size = (double)(end - begin);
    int64_t flags = 0;
    for (int phase = 0; phase < PHASES; phase++) {
        const double u = form->scale[2 * phase], i = form->scale[2 * phase + 1];
        const double volts = sqrt(s.square[2 * phase] / size) * u;
        if (volts > form->dead[phase] || marks_of(form, &s, phase))
            return 0;
        flags |= (int64_t)1 << phase;
        out[ROW(VRMS, phase)] = volts;
        out[ROW(IRMS, phase)] = sqrt(s.square[2 * phase + 1] / size) * i;
        out[ROW(POWER, phase)] = s.cross[phase] / size * (u * i);
        out[ROW(REACTIVE, phase)] = NAN;
        out[ROW(ENERGY, phase)] = s.cross[phase];
    }
    out[F] = NAN;
    out[FLAGS] = (double)flags;
    out[MAGNITUDE] = out[BEND] = out[SWELL] = out[KINK] = out[GROWTH] = 0;
    return 1;
}

/* The same of the next window of a running stream; whether it was metered. */
int64_t acqd_quiet(const struct live *live)
{
    const struct form *form = live->form;
    const int64_t begin = live->bounds[0], end = live->bounds[1];
    if (form->bits == 16)
        return quiet(form, live->codes, 16, begin, end, live->out);
    if (form->bits == 32)
        return quiet(form, live->codes, 32, begin, end, live->out);
    return quiet(form, live->codes, 64, begin, end, live->out);
}
