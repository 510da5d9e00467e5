/* LANES numbers at once: the substeps of a row, or several joints. GCC and clang make vectors of them; other compilers
   take one number at a time, with the same expressions and the library's functions. */
#ifndef ACQD_LANES_H
#define ACQD_LANES_H

#include <math.h>
#include <string.h>

#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC diagnostic ignored "-Wpsabi" /* vectors never cross the border of a translation unit */
#endif

#if defined(__GNUC__) && !defined(ACQD_ONE_LANE)
#define LANES 4
#define INLINE static inline __attribute__((always_inline))
typedef double lanes_t __attribute__((vector_size(32)));
typedef long long mask_t __attribute__((vector_size(32)));
#else
#define LANES 1
#define INLINE static inline
typedef double lanes_t;
typedef int mask_t;
#endif

INLINE lanes_t lanes_from(const double *values)
{
    lanes_t x;
    memcpy(&x, values, sizeof x);
    return x;
}

INLINE void lanes_to(lanes_t x, double *values) { memcpy(values, &x, sizeof x); }

INLINE lanes_t lanes_of(double value)
{
#if LANES > 1
    return (lanes_t){value, value, value, value};
#else
    return value;
#endif
}

/* a where the mask is true, else b */
INLINE lanes_t lanes_choose(mask_t mask, lanes_t a, lanes_t b)
{
#if LANES > 1
    return (lanes_t)((mask & (mask_t)a) | (~mask & (mask_t)b));
#else
    return mask ? a : b;
#endif
}

/* Whether the mask is true anywhere. */
INLINE int lanes_any(mask_t mask)
{
#if LANES > 1
    return (mask[0] | mask[1] | mask[2] | mask[3]) != 0;
#else
    return mask;
#endif
}

INLINE lanes_t lanes_max(lanes_t a, lanes_t b) { return lanes_choose(a > b, a, b); }

INLINE lanes_t lanes_abs(lanes_t x) { return lanes_choose(x < 0.0, -x, x); }

INLINE lanes_t lanes_sqrt(lanes_t x)
{
    double values[LANES];
    lanes_to(x, values);
    for (int k = 0; k < LANES; k++)
        values[k] = sqrt(values[k]);
    return lanes_from(values);
}

#if LANES > 1
#define ROUND_MAGIC 6755399441055744.0 /* 1.5 * 2^52: the sum's last bits hold the nearest integer */

/* exp(x): x = n ln 2 + r, Taylor polynomial of degree 12 in r; error below 1e-15 of the value */
INLINE lanes_t lanes_exp(lanes_t x)
{
    static const double inverse_factorial[] = {
        1.0 / 479001600.0, 1.0 / 39916800.0, 1.0 / 3628800.0, 1.0 / 362880.0, 1.0 / 40320.0, 1.0 / 5040.0,
        1.0 / 720.0, 1.0 / 120.0, 1.0 / 24.0, 1.0 / 6.0, 0.5, 1.0, 1.0
    };
    const lanes_t bounded = lanes_choose(x < -708.0, lanes_of(-708.0), lanes_choose(x > 709.0, lanes_of(709.0), x));
    const lanes_t shifted = bounded * 1.4426950408889634074 + ROUND_MAGIC;
    const lanes_t n = shifted - ROUND_MAGIC;
    const lanes_t r = (bounded - n * 6.93147180369123816490e-01) - n * 1.90821492927058770002e-10;
    lanes_t sum = lanes_of(inverse_factorial[0]);
    for (int k = 1; k < 13; k++)
        sum = sum * r + inverse_factorial[k];
    const mask_t exponent = ((mask_t)shifted + 1023) << 52; /* the magic number's own bits leave at the top */
    return sum * (lanes_t)exponent;
}

/* Sine and cosine: reduction to [-pi/4, pi/4] by pi/2 in three parts (Cody and Waite), minimax polynomials; error below
   1e-15 for |x| < 1e5 */
INLINE void lanes_sincos(lanes_t x, lanes_t *sine, lanes_t *cosine)
{
    const lanes_t shifted = x * 0.63661977236758134308 + ROUND_MAGIC;
    const lanes_t n = shifted - ROUND_MAGIC;
    const mask_t quadrant = (mask_t)shifted;
    const lanes_t r = ((x - n * 1.57079632673412561417e+00) - n * 6.07710050630396597660e-11) -
                      n * 2.02226624879595063154e-21;
    const lanes_t z = r * r;
    const lanes_t s =
        r + r * z * (-1.66666666666666324348e-01 +
                     z * (8.33333333332248946124e-03 +
                          z * (-1.98412698298579493134e-04 +
                               z * (2.75573137070700676789e-06 +
                                    z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)))));
    const lanes_t c =
        1.0 - 0.5 * z + z * z * (4.16666666666666019037e-02 +
                                 z * (-1.38888888888741095749e-03 +
                                      z * (2.48015872894767294178e-05 +
                                           z * (-2.75573143513906633035e-07 +
                                                z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11)))));
    const mask_t swapped = (quadrant & 1) != 0;
    const lanes_t first = lanes_choose(swapped, c, s), second = lanes_choose(swapped, s, c);
    *sine = lanes_choose((quadrant & 2) != 0, -first, first);
    *cosine = lanes_choose(((quadrant + 1) & 2) != 0, -second, second);
}

INLINE lanes_t lanes_tanh(lanes_t x)
{
    const lanes_t e = lanes_exp(-2.0 * lanes_abs(x));
    const lanes_t size = (1.0 - e) / (1.0 + e);
    return lanes_choose(x < 0.0, -size, size);
}
#else
INLINE lanes_t lanes_exp(lanes_t x) { return exp(x); }
INLINE void lanes_sincos(lanes_t x, lanes_t *sine, lanes_t *cosine) { *sine = sin(x), *cosine = cos(x); }
INLINE lanes_t lanes_tanh(lanes_t x) { return tanh(x); }
#endif

#endif
