/* LSTM(10) with an affine head, optionally behind shared convolution kernels: loss and gradient of one mini-batch.
 *
 * A vector holds the same quantity of V sequences: every weight is a broadcast factor, and no lane waits for another.
 * V is chosen at compile time for the instruction set: 16 for AVX-512, 8 for AVX2, 4 otherwise.
 *
 * Arrays, per group of V sequences:  x [T + 2r][axes or width][V],  y [T][V],  weight [V] (0: an unused lane).
 * parameters: kernel [Q][L], kernel_bias [Q], W [40][width], R [40][10], b [40], head [10], head_bias [1].
 */
#include <stddef.h>
#include <string.h>

#ifndef V
#define V 4
#endif
#define H 10
#define G (4 * H)
#define CHUNK 32 /* steps whose gradients are summed at once: they stay in the L2 cache */
#if V == 16
#define ROWS 4 /* gates per block of accumulators: as many as the registers hold */
#else
#define ROWS 1
#endif

typedef float vf __attribute__((vector_size(4 * V)));
typedef int vi __attribute__((vector_size(4 * V)));

typedef struct {
    int steps, groups, axes, kernels, length, width;
} Shape;

static inline vf splat(float s) { return s - (vf){0}; }

static inline vf choose(vi mask, vf a, vf b) { return (vf)(((vi)a & mask) | ((vi)b & ~mask)); }

static inline vf clamp(vf x, float limit) {
    vf high = splat(limit), low = splat(-limit);
    x = choose(x > high, high, x);
    return choose(x < low, low, x);
}

/* e^x to 2e-7: range reduction by a rounding constant, then the polynomial of the Cephes library. */
static inline vf vexp(vf x) {
    vf t = x * 1.44269504088896f + 12582912.0f;
    vf n = t - 12582912.0f;
    vf r = x - n * 0.693359375f + n * 2.12194440e-4f;
    vf p = r * 1.9875691500e-4f + 1.3981999507e-3f;
    p = p * r + 8.3334519073e-3f;
    p = p * r + 4.1665795894e-2f;
    p = p * r + 1.6666665459e-1f;
    p = p * r + 5.0000001201e-1f;
    p = p * r * r + r + 1.0f;
    return (vf)((vi)p + ((vi)t << 23));
}

/* Two logistic functions for one division. */
static inline void sigmoids(vf a, vf b, vf *sa, vf *sb) {
    vf ea = 1.0f + vexp(-clamp(a, 40.0f)), eb = 1.0f + vexp(-clamp(b, 40.0f));
    vf inverse = 1.0f / (ea * eb);
    *sa = inverse * eb;
    *sb = inverse * ea;
}

static inline void tanhs(const vf *c, vf *out) {
    for (int j = 0; j < H; j += 2) {
        vf a, b;
        sigmoids(2.0f * c[j], 2.0f * c[j + 1], &a, &b);
        out[j] = 2.0f * a - 1.0f;
        out[j + 1] = 2.0f * b - 1.0f;
    }
}

/* out[k] += sum over n of weights[n][k] * in[n]: the transposed product. */
static inline void transposed(const float *weights, int count, int width, const vf *in, vf *out) {
    for (int k = 0; k < width; k += 5) {
        int last = width - k < 5 ? width - k : 5;
        vf sum[5] = {{0}};
        if (last == 5)
            for (int n = 0; n < count; n++)
                for (int u = 0; u < 5; u++) sum[u] += weights[n * width + k + u] * in[n];
        else
            for (int n = 0; n < count; n++)
                for (int u = 0; u < last; u++) sum[u] += weights[n * width + k + u] * in[n];
        for (int u = 0; u < last; u++) out[k + u] = sum[u];
    }
}

/* sums[g][k] += over a chunk of da[t][g] * in[t][k]; strides in vectors. */
static inline __attribute__((always_inline)) void outer(const vf *da, const vf *in, int stride, int steps, vf *sums,
                                                        int width, int k, const int columns) {
    for (int g = 0; g < G; g += ROWS) {
        vf sum[ROWS][8];
        for (int i = 0; i < ROWS; i++)
            for (int u = 0; u < columns; u++) sum[i][u] = sums[(g + i) * width + k + u];
        for (int t = 0; t < steps; t++)
            for (int i = 0; i < ROWS; i++) {
                vf d = da[t * G + g + i];
                for (int u = 0; u < columns; u++) sum[i][u] += d * in[t * stride + k + u];
            }
        for (int i = 0; i < ROWS; i++)
            for (int u = 0; u < columns; u++) sums[(g + i) * width + k + u] = sum[i][u];
    }
}

static void outer_all(const vf *da, const vf *in, int stride, int steps, vf *sums, int width) {
    int k = 0;
    for (; k + 7 <= width && width % 7 == 0; k += 7) outer(da, in, stride, steps, sums, width, k, 7);
    for (; k + 6 <= width && width % 6 == 0; k += 6) outer(da, in, stride, steps, sums, width, k, 6);
    for (; k + 5 <= width; k += 5) outer(da, in, stride, steps, sums, width, k, 5);
    for (; k < width; k++) outer(da, in, stride, steps, sums, width, k, 1);
}

static inline __attribute__((always_inline)) void gate_block(const float *W, const float *R, const float *b, int width,
                                                             const vf *x, const vf *h, int g, vf *a) {
    vf sum[8];
    for (int u = 0; u < 8; u++) sum[u] = splat(b[g + u]);
    for (int k = 0; k < width; k++) {
        vf in = x[k];
        for (int u = 0; u < 8; u++) sum[u] += W[(g + u) * width + k] * in;
    }
    for (int j = 0; j < H; j++) {
        vf in = h[j];
        for (int u = 0; u < 8; u++) sum[u] += R[(g + u) * H + j] * in;
    }
    for (int u = 0; u < 8; u++) a[g + u] = sum[u];
}

static void convolve(const Shape *s, const float *kernel, const float *bias, const vf *x, vf *feature) {
    for (int q = 0; q < s->kernels; q++)
        for (int a = 0; a < s->axes; a += 8) { /* axes side by side: independent chains of additions */
            int last = s->axes - a < 8 ? s->axes - a : 8;
            vf sum[8];
            for (int u = 0; u < 8; u++) sum[u] = splat(bias[q]);
            if (last == 7)
                for (int l = 0; l < s->length; l++)
                    for (int u = 0; u < 7; u++) sum[u] += kernel[q * s->length + l] * x[l * s->axes + a + u];
            else
                for (int l = 0; l < s->length; l++)
                    for (int u = 0; u < last; u++) sum[u] += kernel[q * s->length + l] * x[l * s->axes + a + u];
            for (int u = 0; u < last; u++) feature[q * s->axes + a + u] = sum[u];
        }
}

/* sums[u] += over all steps and axes of d[t][a] * x[t + u][a]: the gradient of `taps` neighbouring kernel weights. */
static inline __attribute__((always_inline)) void correlate(const vf *d, int width, const vf *x, int axes, int steps,
                                                            vf *sums, const int taps) {
    vf sum[8];
    for (int u = 0; u < taps; u++) sum[u] = sums[u];
    for (int t = 0; t < steps; t++)
        for (int a = 0; a < axes; a++) {
            vf one = d[(size_t)t * width + a];
            for (int u = 0; u < taps; u++) sum[u] += one * x[(size_t)(t + u) * axes + a];
        }
    for (int u = 0; u < taps; u++) sums[u] = sum[u];
}

/* Scratch memory of one call, in vectors. */
long acqd_scratch(const Shape *s) {
    long per_step = G + 2 * H + (s->kernels ? 2 * s->width : 0);
    return (long)(s->steps + 1) * per_step + G * (s->width + H) + G + s->kernels * (s->length + 1) + 64;
}

/* Returns sum(weight (y^ - y)^2). Adds its gradient to grad and writes the predictions, each unless NULL. */
double acqd_lstm(const Shape *s, const float *parameters, const vf *x, const vf *y, const vf *weight, vf *scratch,
                 float *grad, vf *predicted) {
    const int T = s->steps, width = s->width, conv = s->kernels > 0;
    const int taps = s->kernels * s->length, margin = conv ? s->length - 1 : 0, columns = conv ? s->axes : width;
    const float *kernel = parameters, *kernel_bias = kernel + taps, *W = kernel_bias + s->kernels, *R = W + G * width;
    const float *b = R + G * H, *head = b + G, *head_bias = head + H;
    vf *gates = scratch, *cells = gates + (size_t)T * G, *hidden = cells + (size_t)T * H;
    vf *features = hidden + (size_t)(T + 1) * H, *d_features = features + (conv ? (size_t)T * width : 0);
    vf *sum_W = d_features + (conv ? (size_t)T * width : 0), *sum_R = sum_W + G * width, *sum_b = sum_R + G * H;
    vf *sum_kernel = sum_b + G;
    double total = 0.0;
    if (grad) memset(sum_W, 0, sizeof(vf) * (size_t)(G * width + G * H + G + taps + s->kernels));
    vf sum_head[H] = {{0}}, sum_head_bias = {0};

    for (int group = 0; group < s->groups; group++) {
        const vf *xs = x + (size_t)group * (T + margin) * columns, *ys = y + (size_t)group * T, w = weight[group];
        const vf *in = conv ? features : xs;
        vf h0[H] = {{0}}, loss = {0};
        memset(hidden, 0, sizeof h0); /* hidden[t + 1] belongs to step t */
        for (int t = 0; t < T; t++) {
            vf *a = gates + (size_t)t * G, *c = cells + (size_t)t * H, *h = hidden + (size_t)(t + 1) * H;
            if (conv) convolve(s, kernel, kernel_bias, xs + (size_t)t * columns, features + (size_t)t * width);
            for (int g = 0; g < G; g += 8) gate_block(W, R, b, width, in + (size_t)t * width, h - H, g, a);
            vf cell[H], squashed[H], out = splat(*head_bias);
            for (int j = 0; j < H; j++) {
                sigmoids(a[j], a[H + j], &a[j], &a[H + j]);
                vf candidate;
                sigmoids(2.0f * a[2 * H + j], a[3 * H + j], &candidate, &a[3 * H + j]);
                a[2 * H + j] = 2.0f * candidate - 1.0f;
                cell[j] = a[j] * a[2 * H + j] + (t ? a[H + j] * (c - H)[j] : h0[j]);
                c[j] = cell[j];
            }
            tanhs(cell, squashed);
            for (int j = 0; j < H; j++) {
                h[j] = a[3 * H + j] * squashed[j];
                out += head[j] * h[j];
            }
            if (predicted) predicted[(size_t)group * T + t] = out;
            vf error = out - ys[t];
            loss += w * error * error;
        }
        for (int v = 0; v < V; v++) total += loss[v];
        if (!grad) continue;

        vf dh[H] = {{0}}, dc[H] = {{0}};
        int end = T; /* of the chunk whose gradients are still to be summed */
        for (int t = T - 1; t >= 0; t--) {
            vf *a = gates + (size_t)t * G, *c = cells + (size_t)t * H, *h = hidden + (size_t)(t + 1) * H;
            vf squashed[H], out = splat(*head_bias);
            tanhs(c, squashed);
            for (int j = 0; j < H; j++) out += head[j] * h[j];
            vf dy = 2.0f * w * (out - ys[t]);
            sum_head_bias += dy;
            for (int j = 0; j < H; j++) {
                sum_head[j] += dy * h[j];
                vf i = a[j], f = a[H + j], g = a[2 * H + j], o = a[3 * H + j];
                vf d = dh[j] + head[j] * dy;
                vf dcell = dc[j] + d * o * (1.0f - squashed[j] * squashed[j]);
                a[j] = dcell * g * i * (1.0f - i);
                a[H + j] = (t ? dcell * (c - H)[j] : h0[j]) * f * (1.0f - f);
                a[2 * H + j] = dcell * i * (1.0f - g * g);
                a[3 * H + j] = d * squashed[j] * o * (1.0f - o);
                dc[j] = dcell * f;
            }
            transposed(R, G, H, a, dh);
            if (conv) transposed(W, G, width, a, d_features + (size_t)t * width);
            if (end - t == CHUNK || t == 0) {
                int steps = end - t;
                outer_all(a, in + (size_t)t * width, width, steps, sum_W, width);
                outer_all(a, h - H, H, steps, sum_R, H);
                for (int n = 0; n < steps; n++)
                    for (int g = 0; g < G; g++) sum_b[g] += a[n * G + g];
                end = t;
            }
        }
        for (int q = 0; conv && q < s->kernels; q++) {
            const vf *d = d_features + q * s->axes;
            vf *sums = sum_kernel + q * s->length;
            int l = 0;
            for (; l + 7 <= s->length; l += 7) correlate(d, width, xs + (size_t)l * columns, columns, T, sums + l, 7);
            for (; l + 4 <= s->length; l += 4) correlate(d, width, xs + (size_t)l * columns, columns, T, sums + l, 4);
            for (; l < s->length; l++) correlate(d, width, xs + (size_t)l * columns, columns, T, sums + l, 1);
            for (int t = 0; t < T; t++)
                for (int a = 0; a < s->axes; a++) sum_kernel[taps + q] += d[(size_t)t * width + a];
        }
    }
    if (grad) {
        const vf *sums[] = {sum_kernel, sum_W, sum_R, sum_b, sum_head, &sum_head_bias};
        const int counts[] = {taps + s->kernels, G * width, G * H, G, H, 1};
        for (int part = 0; part < 6; part++)
            for (int n = 0; n < counts[part]; n++, grad++)
                for (int v = 0; v < V; v++) *grad += sums[part][n][v];
    }
    return total;
}
