/* Quantities of a window of 1 to 4 phases: f, sums over whole cycles, energy, DC, peaks, fundamentals.

   The same arithmetic as the numpy path (acqd/metering/reference.py), for windows without anything unusual: whatever
   is unusual (no history yet, f not credible, bent phase, dead mains, a trial frequency whose vectors are not there)
   ends the call before that window, and the caller takes over.

   A vector holds the channels of 8 / channels samples. Samples are interleaved: U1, I1, U2, I2 ... */

#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#ifdef __AVX2__
#include <immintrin.h>
#endif

#define LANES 8
#define PHASORS 7
#define EDGES (2 * PHASORS)
#define COLUMNS 6 /* projection on Re c, -Im c, Re d, -Im d; cos, sin */
#define REMEMBERED 3
#define INLINE static inline __attribute__((always_inline))

typedef double vec __attribute__((vector_size(64)));
typedef long long mask __attribute__((vector_size(64)));
typedef int16_t shorts __attribute__((vector_size(16)));
typedef int32_t ints __attribute__((vector_size(32)));

enum { DONE, NO_HISTORY, NO_TRIAL, UNUSUAL };

struct form {
    int64_t bits, fit, fixed, first_point;
    double rate, cycles, grid, slack, f_low, f_high, trial_low, trial_high, purity, steady, oldest, code_max, code_min;
    double scale[LANES], dead[LANES / 2], bend[PHASORS * PHASORS];
};

struct state {
    double trial, last; /* Hz */
    double f[REMEMBERED], at[REMEMBERED]; /* Hz, samples of the stream */
    int64_t known, reason, point;
};

/* Vectors of a trial: COLUMNS x fit doubles, EDGES positions in rising order, EDGES numbers of phasors (begin: j, end:
   PHASORS + j), and room to read beyond. Where a vector holds one sample, the weights of a sample are neighbours;
   otherwise those of a column are. */
#if CHANNELS > 4
#define WEIGHT(column, sample) ((sample)*COLUMNS + (column))
#else
#define WEIGHT(column, sample) ((column)*samples + (sample))
#endif

struct sums {
    vec square, cross, plain, most, least;
};

struct fit { /* named, not indexed: the compiler keeps them in registers */
    vec re_c, im_c, re_d, im_d, cos, sin;
};

enum part { NO_SUMS, BEFORE, INSIDE }; /* samples whose sums are known; before the window; of the window */

/* The compilers at hand take operations on vectors of this width apart, down to single numbers, where the processor has
   narrower ones: so these are written for what it has. */
#if defined(__AVX512F__)
INLINE vec larger(vec x, vec y) { return (vec)_mm512_max_pd((__m512d)x, (__m512d)y); }
INLINE vec smaller(vec x, vec y) { return (vec)_mm512_min_pd((__m512d)x, (__m512d)y); }
INLINE vec swapped(vec x) { return (vec)_mm512_permute_pd((__m512d)x, 0x55); }
INLINE vec doubles(ints x) { return (vec)_mm512_cvtepi32_pd((__m256i)x); }
#elif defined(__AVX2__)
union halves {
    vec whole;
    __m256d half[2];
};
INLINE vec larger(vec x, vec y)
{
    union halves a = {x}, b = {y};
    return (union halves){.half = {_mm256_max_pd(a.half[0], b.half[0]), _mm256_max_pd(a.half[1], b.half[1])}}.whole;
}
INLINE vec smaller(vec x, vec y)
{
    union halves a = {x}, b = {y};
    return (union halves){.half = {_mm256_min_pd(a.half[0], b.half[0]), _mm256_min_pd(a.half[1], b.half[1])}}.whole;
}
INLINE vec swapped(vec x)
{
    union halves a = {x};
    return (union halves){.half = {_mm256_permute_pd(a.half[0], 5), _mm256_permute_pd(a.half[1], 5)}}.whole;
}
INLINE vec doubles(ints x)
{
    const __m256i i = (__m256i)x;
    return (union halves){.half = {_mm256_cvtepi32_pd(_mm256_castsi256_si128(i)),
                                   _mm256_cvtepi32_pd(_mm256_extracti128_si256(i, 1))}}.whole;
}
#else
INLINE vec chosen(mask which, vec yes, vec no) { return (vec)((which & (mask)yes) | (~which & (mask)no)); }
INLINE vec larger(vec x, vec y) { return chosen(x > y, x, y); }
INLINE vec smaller(vec x, vec y) { return chosen(x < y, x, y); }
INLINE vec swapped(vec x) { return __builtin_shuffle(x, (mask){1, 0, 3, 2, 5, 4, 7, 6}); } /* u and i */
INLINE vec doubles(ints x) { return __builtin_convertvector(x, vec); }
#endif

INLINE ints widened(shorts x)
{
#ifdef __AVX2__
    return (ints)_mm256_cvtepi16_epi32((__m128i)x);
#else
    return __builtin_convertvector(x, ints);
#endif
}

INLINE vec load(const void *codes, int bits, ptrdiff_t at, int count)
{
    if (bits == 16) {
        shorts s = {0};
        memcpy(&s, (const int16_t *)codes + at, (size_t)count * sizeof(int16_t));
        return doubles(widened(s));
    }
    if (bits == 32) {
        ints s = {0};
        memcpy(&s, (const int32_t *)codes + at, (size_t)count * sizeof(int32_t));
        return doubles(s);
    }
    vec s = {0};
    memcpy(&s, (const double *)codes + at, (size_t)count * sizeof(double));
    return s;
}

/* The next weights of a column, each for all channels of its sample. */
INLINE vec spread(const double *weight, int channels)
{
    if (channels > 4)
        return (vec){*weight, *weight, *weight, *weight, *weight, *weight, *weight, *weight};
    vec w;
    memcpy(&w, weight, sizeof w);
    return channels == 4 ? __builtin_shuffle(w, (mask){0, 0, 0, 0, 1, 1, 1, 1})
                         : __builtin_shuffle(w, (mask){0, 0, 1, 1, 2, 2, 3, 3});
}

INLINE struct fit with_sample(struct fit f, vec x, const double *trial, int64_t n, int64_t samples, int channels)
{
    f.re_c += x * spread(trial + WEIGHT(0, n), channels);
    f.im_c += x * spread(trial + WEIGHT(1, n), channels);
    f.re_d += x * spread(trial + WEIGHT(2, n), channels);
    f.im_d += x * spread(trial + WEIGHT(3, n), channels);
    f.cos += x * spread(trial + WEIGHT(4, n), channels);
    f.sin += x * spread(trial + WEIGHT(5, n), channels);
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

/* Sum over the samples that share a vector: channel c of the result is in lane c. */
INLINE vec fold(vec v, int channels)
{
    if (channels <= 4)
        v += __builtin_shuffle(v, (mask){4, 5, 6, 7, 0, 1, 2, 3});
    if (channels <= 2)
        v += __builtin_shuffle(v, (mask){2, 3, 0, 1, 6, 7, 4, 5});
    return v;
}

/* Samples from .. to of the stretch, into the projection and the sums of their part of it. */
INLINE void take(struct fit *fit, struct sums *sums, enum part part, const void *codes, int bits, int channels,
                 int64_t samples, ptrdiff_t from, ptrdiff_t to, const double *trial)
{
    const int together = LANES / channels;
    const ptrdiff_t whole = to < samples ? to : samples - 1; /* after the last sample there is nothing to read */
    struct fit f = *fit;
    struct sums s = *sums;
    ptrdiff_t n = from;
    for (; n + together <= whole; n += together) {
        const vec x = load(codes, bits, n * channels, LANES);
        f = with_sample(f, x, trial, n, samples, channels);
        s = with_products(s, x, part);
    }
    for (; n < to; n++) { /* other lanes are 0, which is between least and most */
        const vec x = load(codes, bits, n * channels, channels);
        f = with_sample(f, x, trial, n, samples, channels);
        s = with_products(s, x, part);
    }
    *fit = f;
    *sums = s;
}

/* Projection of `samples` samples; integrals of cos and sin up to each edge, [EDGES][2]. Unless they are `known`, sums
   of the samples before number `inside` and, with all that a window needs, from there on. One pass over the samples. */
INLINE struct fit project(vec edges[EDGES][2], struct sums *before, struct sums *window, int known, const void *codes,
                          int bits, int channels, int64_t samples, int64_t inside, const double *trial)
{
    const double *position = trial + COLUMNS * samples, *number = position + EDGES;
    struct fit f = {0};
    ptrdiff_t n = 0;
    for (int e = 0; e <= EDGES; e++) {
        const ptrdiff_t stop = e < EDGES ? (ptrdiff_t)position[e] : samples;
        const ptrdiff_t first = known ? stop : stop < inside ? stop : inside;
        if (n < first) {
            take(&f, before, known ? NO_SUMS : BEFORE, codes, bits, channels, samples, n, first, trial);
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
            cosine += x * trial[WEIGHT(4, stop)];
            sine += x * trial[WEIGHT(5, stop)];
        }
        edges[place][0] = cosine;
        edges[place][1] = sine;
    }
    f.re_c = fold(f.re_c, channels);
    f.im_c = fold(f.im_c, channels);
    f.re_d = fold(f.re_d, channels);
    f.im_d = fold(f.im_d, channels);
    return f;
}

/* Largest distance of a one-cycle phase from the parabola through all [rad]. */
static double unsteadiness(vec edges[EDGES][2], int channels, const double *bend)
{
    double joint[PHASORS][2] = {{0}}, phase[PHASORS], largest = 0;
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
    for (int j = 0; j < PHASORS; j++)
        phase[j] = atan2(joint[j][1], joint[j][0]);
    for (int j = 0; j < PHASORS; j++) {
        double rest = 0;
        for (int k = 0; k < PHASORS; k++)
            rest += phase[k] * bend[k * PHASORS + j];
        largest = fmax(largest, fabs(rest));
    }
    return largest;
}

/* The f of the stretch [Hz], its projection and the sums of the window, which begins with its sample `inside`; 0 with
   the reason in `state` where f is not usable. */
INLINE double frequency(const struct form *form, struct state *state, struct fit *fit, struct sums *window,
                        const void *codes, int bits, int channels, int64_t inside, const double *const *table)
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
        const vec weight = re * re + im * im;
        double turns = 0, weights = 0, power = 0;
        for (int c = 0; c < channels; c += 2) {
            turns += turn[c];
            weights += weight[c];
            power += ac[c];
        }
        f = (double)point * form->grid + turns / fmax(weights, 1e-30) / (2 * M_PI);
        if (fabs(f - (double)point * form->grid) > form->slack * form->grid)
            continue;
        const int credible = f >= form->f_low && f <= form->f_high && weights / 2 >= form->purity * fmax(power, 1e-30);
        if (!credible || unsteadiness(edges, channels, form->bend) > form->steady)
            break;
        return f;
    }
    state->reason = UNUSUAL;
    return 0;
}

/* f at `to`, from its value at `at` and the slope over the last estimates; remembers it. */
static double middle(const struct form *form, struct state *s, double f, double at, double to)
{
    int64_t before = s->known < REMEMBERED ? 0 : s->known - REMEMBERED;
    while (before < s->known && at - s->at[before] > form->oldest)
        before++;
    const int told = before < s->known && at > s->at[before];
    const double slope = told ? (f - s->f[before]) / (at - s->at[before]) : 0;
    if (s->known == REMEMBERED) {
        memmove(s->f, s->f + 1, sizeof s->f - sizeof *s->f);
        memmove(s->at, s->at + 1, sizeof s->at - sizeof *s->at);
        s->known--;
    }
    s->f[s->known] = f;
    s->at[s->known++] = at;
    return f + slope * (to - at);
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

/* Rows of the result, each with one value per window. Then 12 rows per phase: Vrms, Irms, P, energy, DC and largest
   magnitude of voltage and current, real and imaginary part of the fundamentals of both. */
enum { RAW_F, F, FLAGS, PHASES };
enum { VRMS, IRMS, POWER, ENERGY, U_DC, I_DC, U_PEAK, I_PEAK, U_RE, U_IM, I_RE, I_IM, PER_PHASE };

INLINE int one_window(const struct form *form, struct state *state, const double *const *table, const void *codes,
                      int bits, int channels, int64_t begin, int64_t end, double stream, double *out, int64_t stride)
{
    struct fit fit;
    struct sums inner, outer = {0};
    struct state next = *state;
    if (end < form->fit)
        return (int)(state->reason = NO_HISTORY);
    const size_t width = bits == 16 ? 2 : bits == 32 ? 4 : 8;
    const char *stretch = (const char *)codes + (size_t)(end - form->fit) * (size_t)channels * width;
    const int64_t inside = begin - (end - form->fit);
    const double raw = frequency(form, &next, &fit, &outer, stretch, bits, channels, inside, table);
    state->point = next.point;
    if (!raw)
        return (int)(state->reason = next.reason);
    const double size = (double)(end - begin), at = stream + (double)end - (double)form->fit / 2;
    const double about = form->cycles * form->rate / raw;
    double to = form->fixed || size >= about ? ((double)begin + (double)end) / 2 : (double)end - about / 2;
    const double f = middle(form, &next, raw, at, stream + to);
    double length = form->fixed ? size : form->cycles * form->rate / f, start = (double)begin;
    if (!form->fixed)
        start = size >= length ? (double)begin + (size - length) / 2 : (double)end - length;
    if (start < 0)
        return (int)(state->reason = NO_HISTORY);
    const double stop = fmin(start + length, (double)end);
    inner = interval(outer, codes, bits, channels, begin, end, start, stop);
    outer = folded(outer, channels);
    length = stop - start;
    int64_t flags = 0, live = 0;
    for (int c = 0; c < channels; c += 2) {
        double *phase = out + (PHASES + c / 2 * PER_PHASE) * stride;
        const double u = form->scale[c], i = form->scale[c + 1];
        const double volts = sqrt(fmax(inner.square[c] / length, 0)) * u;
        phase[VRMS * stride] = volts;
        phase[IRMS * stride] = sqrt(fmax(inner.square[c + 1] / length, 0)) * i;
        phase[POWER * stride] = inner.cross[c] / length * (u * i);
        phase[ENERGY * stride] = outer.cross[c];
        phase[U_DC * stride] = outer.plain[c] / size * u;
        phase[I_DC * stride] = outer.plain[c + 1] / size * i;
        phase[U_PEAK * stride] = fmax(outer.most[c], -outer.least[c]) * u;
        phase[I_PEAK * stride] = fmax(outer.most[c + 1], -outer.least[c + 1]) * i;
        phase[U_RE * stride] = fit.re_c[c] * u;
        phase[U_IM * stride] = -fit.im_c[c] * u;
        phase[I_RE * stride] = fit.re_c[c + 1] * i;
        phase[I_IM * stride] = -fit.im_c[c + 1] * i;
        if (volts > form->dead[c / 2])
            live++;
        else
            flags |= (int64_t)1 << c / 2;
        for (int k = c; k < c + 2; k++)
            if (outer.most[k] >= form->code_max || outer.least[k] <= form->code_min)
                flags |= (int64_t)16 << c / 2;
    }
    if (!live)
        return (int)(state->reason = UNUSUAL);
    out[RAW_F * stride] = raw;
    out[F * stride] = f;
    out[FLAGS * stride] = (double)flags;
    next.trial = raw;
    next.last = f;
    next.reason = DONE;
    *state = next;
    return DONE;
}

/* Meters windows bounds[k] .. bounds[k + 1] of the samples at `codes`, of which the first is number `stream`; returns
   how many. Fewer than `windows`: state->reason. Compiled once per number of channels (-DCHANNELS=6). */
#define METER(BITS)                                                                                                    \
    while (done < windows                                                                                              \
           && one_window(form, state, table, codes, BITS, CHANNELS, bounds[done], bounds[done + 1], stream,            \
                         out + done, windows) == DONE)                                                                 \
        done++;

int64_t acqd_windows(const struct form *form, struct state *state, const double *const *table, const void *codes,
                     const int64_t *bounds, int64_t windows, double stream, double *out)
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

int64_t acqd_form_bytes(void) { return sizeof(struct form); }
int64_t acqd_state_bytes(void) { return sizeof(struct state); }
