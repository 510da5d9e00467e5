/* Quantities of a window of 1 to 4 phases: f, sums over whole cycles, energy, reactive power of the fundamentals.

   The same arithmetic as the numpy path (acqd/metering/meter.py), for windows without anything unusual: whatever
   is unusual (no history yet, f not credible, bent phase, dead mains, a trial frequency whose vectors are not there)
   ends the call before that window, and the caller takes over.

   A vector holds the channels of 8 / channels samples. Samples are interleaved: U1, I1, U2, I2 ... */

#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "vectors.h"

#define PHASORS 7
#define EDGES (2 * PHASORS)
#define COLUMNS 10 /* projection on Re c, -Im c, Re d, -Im d, Re d and -Im d of the stretch, Re k, -Im k; cos, sin */

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

/* Vectors of a trial: COLUMNS x fit doubles, EDGES positions in rising order, EDGES numbers of phasors (begin: j, end:
   PHASORS + j), the first sample of the two cycles, and room to read beyond. Where a vector holds one sample, the weights of a sample are neighbours;
   otherwise those of a column are. */
#if CHANNELS > 4
#define WEIGHT(column, sample) ((sample)*COLUMNS + (column))
#else
#define WEIGHT(column, sample) ((column)*samples + (sample))
#endif

struct sums {
    vec square, cross, plain, most, least;
};

struct fit {
    vec re_c, im_c, re_d, im_d, re_e, im_e, re_k, im_k, cos, sin; /* d of the cycles, e of the stretch, k of a kink */
};

/* Samples whose sums are known; before the two cycles, where c and d have no weight; between these and the window; of
   the window. */
enum part { NO_SUMS, EARLY, BEFORE, INSIDE };

INLINE struct fit with_sample(struct fit f, vec x, enum part part, const double *trial, int64_t n, int64_t samples,
                              int channels)
{
    if (part != EARLY) {
        f.re_c += x * spread(trial + WEIGHT(0, n), channels);
        f.im_c += x * spread(trial + WEIGHT(1, n), channels);
        f.re_d += x * spread(trial + WEIGHT(2, n), channels);
        f.im_d += x * spread(trial + WEIGHT(3, n), channels);
    }
    f.re_e += x * spread(trial + WEIGHT(4, n), channels);
    f.im_e += x * spread(trial + WEIGHT(5, n), channels);
    f.re_k += x * spread(trial + WEIGHT(6, n), channels);
    f.im_k += x * spread(trial + WEIGHT(7, n), channels);
    f.cos += x * spread(trial + WEIGHT(8, n), channels);
    f.sin += x * spread(trial + WEIGHT(9, n), channels);
    return f;
}

INLINE struct sums with_products(struct sums s, vec x, enum part part)
{
    if (part == NO_SUMS)
        return s;
    s.square += x * x;
    s.plain += x;
    if (part == INSIDE) {
        s.cross += x * swapped(x);
        s.most = larger(x, s.most);
        s.least = smaller(x, s.least);
    }
    return s;
}

/* Samples from .. to into the projection and into the sums of their part of the stretch; reads one sample beyond. One
   part of the channels after the other, so that all that is summed up stays in registers. */
INLINE void take_many(struct fit *f, struct sums *s, enum part part, const void *codes, int bits, int channels,
                      int64_t samples, ptrdiff_t from, ptrdiff_t to, const double *trial)
{
    const int each = channels >= NATIVE ? 1 : NATIVE / channels;
#pragma GCC unroll 3
    for (int p = 0; NATIVE * p < channels; p++) {
        native re_c = lanes(&f->re_c, p), im_c = lanes(&f->im_c, p), re_d = lanes(&f->re_d, p);
        native im_d = lanes(&f->im_d, p), re_e = lanes(&f->re_e, p), im_e = lanes(&f->im_e, p);
        native re_k = lanes(&f->re_k, p), im_k = lanes(&f->im_k, p);
        native cos = lanes(&f->cos, p), sin = lanes(&f->sin, p);
        native square = lanes(&s->square, p), cross = lanes(&s->cross, p), plain = lanes(&s->plain, p);
        native most = lanes(&s->most, p), least = lanes(&s->least, p);
        for (ptrdiff_t n = from; n < to; n += each) {
            const native x = native_load(codes, bits, n * channels + NATIVE * p);
            if (part != EARLY) {
                re_c += x * native_spread(trial + WEIGHT(0, n), each);
                im_c += x * native_spread(trial + WEIGHT(1, n), each);
                re_d += x * native_spread(trial + WEIGHT(2, n), each);
                im_d += x * native_spread(trial + WEIGHT(3, n), each);
            }
            re_e += x * native_spread(trial + WEIGHT(4, n), each);
            im_e += x * native_spread(trial + WEIGHT(5, n), each);
            re_k += x * native_spread(trial + WEIGHT(6, n), each);
            im_k += x * native_spread(trial + WEIGHT(7, n), each);
            cos += x * native_spread(trial + WEIGHT(8, n), each);
            sin += x * native_spread(trial + WEIGHT(9, n), each);
            if (part == NO_SUMS)
                continue;
            square += x * x;
            plain += x;
            if (part == INSIDE) {
                cross += x * native_swapped(x);
                most = native_larger(x, most);
                least = native_smaller(x, least);
            }
        }
        set_lanes(&f->re_c, p, re_c);
        set_lanes(&f->im_c, p, im_c);
        set_lanes(&f->re_d, p, re_d);
        set_lanes(&f->im_d, p, im_d);
        set_lanes(&f->re_e, p, re_e);
        set_lanes(&f->im_e, p, im_e);
        set_lanes(&f->re_k, p, re_k);
        set_lanes(&f->im_k, p, im_k);
        set_lanes(&f->cos, p, cos);
        set_lanes(&f->sin, p, sin);
        set_lanes(&s->square, p, square);
        set_lanes(&s->cross, p, cross);
        set_lanes(&s->plain, p, plain);
        set_lanes(&s->most, p, most);
        set_lanes(&s->least, p, least);
    }
}

/* Samples from .. to of the stretch, into the projection and the sums of their part of it. */
INLINE void take(struct fit *fit, struct sums *sums, enum part part, const void *codes, int bits, int channels,
                 int64_t samples, ptrdiff_t from, ptrdiff_t to, const double *trial)
{
    const int each = channels >= NATIVE ? 1 : NATIVE / channels;
    const ptrdiff_t whole = to < samples ? to : samples - 1; /* after the last sample there is nothing to read */
    const ptrdiff_t many = whole > from ? (whole - from) / each * each : 0;
    take_many(fit, sums, part, codes, bits, channels, samples, from, from + many, trial);
    for (ptrdiff_t n = from + many; n < to; n++) { /* other lanes are 0, which is between least and most */
        const vec x = load(codes, bits, n * channels, channels);
        *fit = with_sample(*fit, x, part, trial, n, samples, channels);
        *sums = with_products(*sums, x, part);
    }
}

/* Projection of `samples` samples; integrals of cos and sin up to each edge, [EDGES][2]. Unless they are `known`, sums
   of the samples before number `inside` and, with all that a window needs, from there on. One pass over the samples. */
INLINE struct fit project(vec edges[EDGES][2], struct sums *before, struct sums *window, int known, const void *codes,
                          int bits, int channels, int64_t samples, int64_t inside, const double *trial)
{
    const double *position = trial + COLUMNS * samples, *number = position + EDGES;
    const int64_t begun = (int64_t)number[EDGES] < inside ? (int64_t)number[EDGES] : inside;
    struct fit f = {0};
    ptrdiff_t n = 0;
    for (int e = 0; e <= EDGES; e++) {
        const ptrdiff_t stop = e < EDGES ? (ptrdiff_t)position[e] : samples;
        if (known && n < stop) {
            take(&f, before, NO_SUMS, codes, bits, channels, samples, n, stop, trial);
            n = stop;
        }
        const ptrdiff_t early = stop < begun ? stop : begun, first = stop < inside ? stop : inside;
        if (n < early) {
            take(&f, before, EARLY, codes, bits, channels, samples, n, early, trial);
            n = early;
        }
        if (n < first) {
            take(&f, before, BEFORE, codes, bits, channels, samples, n, first, trial);
            n = first;
        }
        if (n < stop) {
            take(&f, window, INSIDE, codes, bits, channels, samples, n, stop, trial);
            n = stop;
        }
        if (e == EDGES)
            break;
        const int place = (int)number[e];
        const double share = position[e] - (double)stop;
        vec cosine = fold(f.cos, channels), sine = fold(f.sin, channels);
        if (stop < samples) {
            const vec x = load(codes, bits, stop * channels, channels) * share;
            cosine += x * trial[WEIGHT(8, stop)];
            sine += x * trial[WEIGHT(9, stop)];
        }
        edges[place][0] = cosine;
        edges[place][1] = sine;
    }
    f.re_c = fold(f.re_c, channels);
    f.im_c = fold(f.im_c, channels);
    f.re_d = fold(f.re_d, channels);
    f.im_d = fold(f.im_d, channels);
    f.re_e = fold(f.re_e, channels);
    f.im_e = fold(f.im_e, channels);
    f.re_k = fold(f.re_k, channels);
    f.im_k = fold(f.im_k, channels);
    return f;
}

/* What the one-cycle phasors say: distance of a phase from the parabola through all [rad], the largest; half of what
   ln(magnitude) varies by. What a step of f shortly before their end would move f by, and the same
   of ln(magnitude) [Hz]. */
struct cycles {
    double bend, swell, kink, growth;
};

static struct cycles cycles_of(vec edges[EDGES][2], int channels, const double *bend)
{
    double joint[PHASORS][2] = {{0}}, phase[PHASORS], largest = 0, least = INFINITY, most = 0;
    for (int c = 0; c < channels; c += 2) {
        double re[PHASORS], im[PHASORS], mean_re = 0, mean_im = 0;
        for (int j = 0; j < PHASORS; j++) {
            re[j] = edges[PHASORS + j][0][c] - edges[j][0][c];
            im[j] = edges[j][1][c] - edges[PHASORS + j][1][c];
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

/* f [Hz], the projection of the stretch and the sums of the window, which begins with its sample `inside`; 0 with the
   reason in `state` where f is not usable. */
INLINE double frequency(const struct form *form, struct state *state, struct fit *fit, struct sums *window,
                        const void *codes, int bits, int channels, int64_t inside, const double *const *table,
                        struct cycles *cycles)
{
    double f = state->trial;
    struct sums before = {0};
    vec edges[EDGES][2], ac = {0};
    for (int step = 0; step < 4; step++) {
        const int64_t point = (int64_t)rint(fmin(fmax(f, form->trial_low), form->trial_high) / form->grid);
        const double *trial = table[point - form->first_point];
        if (!trial) {
            state->reason = NO_TRIAL;
            state->point = point;
            return 0;
        }
        if (!step) {
            *fit = project(edges, &before, window, 0, codes, bits, channels, form->fit, inside, trial);
            const vec plain = fold(before.plain + window->plain, channels);
            ac = fold(before.square + window->square, channels) / (double)form->fit
               - plain * plain / ((double)form->fit * (double)form->fit);
        } else {
            *fit = project(edges, &before, window, 1, codes, bits, channels, form->fit, inside, trial);
        }
        const vec re = fit->re_c, im = fit->im_c, turn = im * fit->re_d - re * fit->im_d;
        const vec slow = im * fit->re_e - re * fit->im_e, weight = re * re + im * im;
        const vec late = im * fit->re_k - re * fit->im_k, grown = re * fit->re_k + im * fit->im_k;
        double turns = 0, slow_turns = 0, late_turns = 0, growths = 0, weights = 0, power = 0;
        for (int c = 0; c < channels; c += 2) {
            turns += turn[c];
            slow_turns += slow[c];
            late_turns += late[c];
            growths += grown[c];
            weights += weight[c];
            power += ac[c];
        }
        const double turned = 2 * M_PI * fmax(weights, 1e-30);
        f = (double)point * form->grid + turns / turned;
        if (fabs(f - (double)point * form->grid) > form->slack * form->grid)
            continue;
        const int credible = f >= form->f_low && f <= form->f_high && weights / 2 >= form->purity * fmax(power, 1e-30);
        if (!credible)
            break;
        *cycles = cycles_of(edges, channels, form->bend);
        cycles->kink = fabs(late_turns) / fmax(weights, 1e-30);
        cycles->growth = fabs(growths) / fmax(weights, 1e-30);
        if (cycles->bend > form->steady)
            break;
        return joint(form, state, f, (double)point * form->grid + slow_turns / turned);
    }
    state->reason = UNUSUAL;
    return 0;
}

/* Squares and products of samples from .. to, added to `out` or, with the sign -1, taken away. */
INLINE void add_range(struct sums *out, double sign, const void *codes, int bits, int channels, int64_t samples,
                      int64_t from, int64_t to)
{
    const int together = LANES / channels;
    vec square = {0}, cross = {0};
    int64_t n = from;
    for (; n + together <= to && n < samples - 1; n += together) {
        const vec x = load(codes, bits, n * channels, LANES);
        square += x * x;
        cross += x * swapped(x);
    }
    for (; n < to; n++) {
        const vec x = load(codes, bits, n * channels, channels);
        square += x * x;
        cross += x * swapped(x);
    }
    out->square += sign * square;
    out->cross += sign * cross;
}

/* Integral of squares and products over the first `share` of a cell: the straight line through its neighbours. */
INLINE void add_part(struct sums *out, const void *codes, int bits, int channels, int64_t samples, int64_t cell,
                     double share, double sign)
{
    const int64_t last = samples - 1, here = cell < last ? cell : last;
    const int64_t next = here < last ? here + 1 : last, before = here > 0 ? here - 1 : 0;
    const vec x = load(codes, bits, here * channels, channels), y = load(codes, bits, next * channels, channels);
    const vec z = load(codes, bits, before * channels, channels);
    const double bow = (share * share - share) / 4;
    out->square += sign * (share * (x * x) + bow * (y * y - z * z));
    out->cross += sign * (share * (x * swapped(x))
                          + bow * (y * swapped(y) - z * swapped(z)));
}

INLINE struct sums folded(struct sums s, int channels)
{
    s.square = fold(s.square, channels);
    s.cross = fold(s.cross, channels);
    s.plain = fold(s.plain, channels);
    if (channels <= 4) {
        const mask half = {4, 5, 6, 7, 0, 1, 2, 3};
        const vec most = __builtin_shuffle(s.most, half), least = __builtin_shuffle(s.least, half);
        s.most = larger(most, s.most);
        s.least = smaller(least, s.least);
    }
    if (channels <= 2) {
        const mask pair = {2, 3, 0, 1, 6, 7, 4, 5};
        const vec most = __builtin_shuffle(s.most, pair), least = __builtin_shuffle(s.least, pair);
        s.most = larger(most, s.most);
        s.least = smaller(least, s.least);
    }
    return s;
}

/* Sums over the interval start .. stop, which ends in the window, from those over the window. Sums of integer codes are
   exact: what is added and taken away again leaves nothing. */
INLINE struct sums interval(struct sums window, const void *codes, int bits, int channels, int64_t begin, int64_t end,
                            double start, double stop)
{
    const int64_t a = (int64_t)floor(start), b = (int64_t)floor(stop);
    struct sums inner = window;
    if (a >= begin)
        add_range(&inner, -1, codes, bits, channels, end, begin, a);
    else
        add_range(&inner, 1, codes, bits, channels, end, a, begin);
    add_range(&inner, -1, codes, bits, channels, end, b, end);
    inner.square = fold(inner.square, channels);
    inner.cross = fold(inner.cross, channels);
    add_part(&inner, codes, bits, channels, end, a, start - (double)a, -1);
    add_part(&inner, codes, bits, channels, end, b, stop - (double)b, 1);
    return inner;
}

/* Rows of the result, each with one value per window; from FIRST on, each quantity has one row per phase. */
enum { F, FLAGS, MAGNITUDE, BEND, SWELL, KINK, GROWTH, FIRST };
enum { ENERGY, VRMS, IRMS, POWER, REACTIVE };
#define ROW(quantity, phase) (FIRST + (quantity) * (channels / 2) + (phase))

INLINE int one_window(const struct form *form, struct state *state, const double *const *table, const void *codes,
                      int bits, int channels, int64_t begin, int64_t end, double *out, int64_t stride)
{
    struct fit fit;
    struct sums inner, outer = {0};
    struct state next = *state;
    if (end < form->fit)
        return (int)(state->reason = NO_HISTORY);
    const size_t width = bits == 16 ? 2 : bits == 32 ? 4 : 8;
    const char *stretch = (const char *)codes + (size_t)(end - form->fit) * (size_t)channels * width;
    const int64_t inside = begin - (end - form->fit);
    struct cycles cycles = {0};
    const double f = frequency(form, &next, &fit, &outer, stretch, bits, channels, inside, table, &cycles);
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
    inner = interval(outer, stretch, bits, channels, inside, form->fit, start, stop);
    outer = folded(outer, channels);
    length = stop - start;
    int64_t flags = 0, live = 0;
    double magnitude = 0;
    for (int c = 0; c < channels; c += 2) {
        const int phase = c / 2;
        const double u = form->scale[c], i = form->scale[c + 1];
        const double volts = sqrt(fmax(inner.square[c] / length, 0)) * u;
        const double u_re = fit.re_c[c] * u, u_im = -fit.im_c[c] * u, i_re = fit.re_c[c + 1] * i;
        const double i_im = -fit.im_c[c + 1] * i;
        magnitude += fit.re_c[c] * fit.re_c[c] + fit.im_c[c] * fit.im_c[c];
        out[ROW(VRMS, phase) * stride] = volts;
        out[ROW(IRMS, phase) * stride] = sqrt(fmax(inner.square[c + 1] / length, 0)) * i;
        out[ROW(POWER, phase) * stride] = inner.cross[c] / length * (u * i);
        out[ROW(REACTIVE, phase) * stride] = (u_im * i_re - u_re * i_im) / 2;
        out[ROW(ENERGY, phase) * stride] = outer.cross[c];
        if (volts > form->dead[phase])
            live++;
        else
            flags |= (int64_t)1 << phase;
        for (int k = c; k < c + 2; k++)
            if (outer.most[k] >= form->code_max || outer.least[k] <= form->code_min)
                flags |= (int64_t)16 << phase;
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
           && one_window(form, state, table, codes, BITS, CHANNELS, bounds[done], bounds[done + 1], out + done,        \
                         windows) == DONE)                                                                             \
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
INLINE int quiet(const struct form *form, const void *codes, int bits, int channels, int64_t begin, int64_t end,
                 double *out)
{
    const int each = channels >= NATIVE ? 1 : NATIVE / channels;
    const int64_t many = begin + (end - 1 - begin) / each * each; /* after the last sample there is nothing to read */
    struct sums s = {0};
#pragma GCC unroll 3
    for (int p = 0; NATIVE * p < channels; p++) {
        native square = lanes(&s.square, p), cross = lanes(&s.cross, p);
        native most = lanes(&s.most, p), least = lanes(&s.least, p);
        for (int64_t n = begin; n < many; n += each) {
            const native x = native_load(codes, bits, n * channels + NATIVE * p);
            square += x * x;
            cross += x * native_swapped(x);
            most = native_larger(x, most);
            least = native_smaller(x, least);
        }
        set_lanes(&s.square, p, square);
        set_lanes(&s.cross, p, cross);
        set_lanes(&s.most, p, most);
        set_lanes(&s.least, p, least);
    }
    for (int64_t n = many; n < end; n++)
        s = with_products(s, load(codes, bits, n * channels, channels), INSIDE);
    s = folded(s, channels);
    const double size = (double)(end - begin);
    int64_t flags = 0;
    for (int c = 0; c < channels; c += 2) {
        const int phase = c / 2;
        const double u = form->scale[c], i = form->scale[c + 1], volts = sqrt(s.square[c] / size) * u;
        if (volts > form->dead[phase])
            return 0;
        for (int k = c; k < c + 2; k++)
            if (s.most[k] >= form->code_max || s.least[k] <= form->code_min)
                return 0;
        flags |= (int64_t)1 << phase;
        out[ROW(VRMS, phase)] = volts;
        out[ROW(IRMS, phase)] = sqrt(s.square[c + 1] / size) * i;
        out[ROW(POWER, phase)] = s.cross[c] / size * (u * i);
        out[ROW(REACTIVE, phase)] = NAN;
        out[ROW(ENERGY, phase)] = s.cross[c];
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
        return quiet(form, live->codes, 16, CHANNELS, begin, end, live->out);
    if (form->bits == 32)
        return quiet(form, live->codes, 32, CHANNELS, begin, end, live->out);
    return quiet(form, live->codes, 64, CHANNELS, begin, end, live->out);
}
