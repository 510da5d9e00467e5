/* Vectors of eight numbers, and of as many as the processor takes at once. */

#ifndef ACQD_VECTORS_H
#define ACQD_VECTORS_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>
#ifdef __SSE2__
#include <immintrin.h>
#endif

#define LANES 8
#define INLINE static inline __attribute__((always_inline))

typedef double vec __attribute__((vector_size(64)));
typedef long long mask __attribute__((vector_size(64)));
typedef int16_t shorts __attribute__((vector_size(16)));
typedef int32_t ints __attribute__((vector_size(32)));

INLINE vec chosen(mask which, vec yes, vec no)
{
    return (vec)((which & (mask)yes) | (~which & (mask)no));
}

INLINE vec larger(vec x, vec y)
{
    return chosen(x > y, x, y);
}

INLINE vec smaller(vec x, vec y)
{
    return chosen(x < y, x, y);
}

INLINE vec swapped(vec x) /* u and i */
{
    return __builtin_shuffle(x, (mask){1, 0, 3, 2, 5, 4, 7, 6});
}

INLINE vec load(const void *codes, int bits, ptrdiff_t at, int count)
{
    if (bits == 16) {
        shorts s = {0};
        memcpy(&s, (const int16_t *)codes + at, (size_t)count * sizeof(int16_t));
        return __builtin_convertvector(__builtin_convertvector(s, ints), vec);
    }
    if (bits == 32) {
        ints s = {0};
        memcpy(&s, (const int32_t *)codes + at, (size_t)count * sizeof(int32_t));
        return __builtin_convertvector(s, vec);
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

/* Sum over the samples that share a vector: channel c of the result is in lane c. */
INLINE vec fold(vec v, int channels)
{
    if (channels <= 4)
        v += __builtin_shuffle(v, (mask){4, 5, 6, 7, 0, 1, 2, 3});
    if (channels <= 2)
        v += __builtin_shuffle(v, (mask){2, 3, 0, 1, 6, 7, 4, 5});
    return v;
}

/* What the processor has: the compilers at hand take operations on wider vectors apart, down to single numbers. */
#if defined(__AVX512F__)
#define NATIVE 8
#elif defined(__AVX2__)
#define NATIVE 4
#else
#define NATIVE 2
#endif
typedef double native __attribute__((vector_size(8 * NATIVE)));
typedef long long native_mask __attribute__((vector_size(8 * NATIVE)));

INLINE native native_load(const void *codes, int bits, ptrdiff_t at)
{
    native x;
    if (bits == 16) {
        const int16_t *c = (const int16_t *)codes + at;
#if NATIVE == 8
        x = (native)_mm512_cvtepi32_pd(_mm256_cvtepi16_epi32(_mm_loadu_si128((const void *)c)));
#elif NATIVE == 4
        x = (native)_mm256_cvtepi32_pd(_mm_cvtepi16_epi32(_mm_loadl_epi64((const void *)c)));
#else
        x = (native){c[0], c[1]};
#endif
    } else if (bits == 32) {
        const int32_t *c = (const int32_t *)codes + at;
#if NATIVE == 8
        x = (native)_mm512_cvtepi32_pd(_mm256_loadu_si256((const void *)c));
#elif NATIVE == 4
        x = (native)_mm256_cvtepi32_pd(_mm_loadu_si128((const void *)c));
#else
        x = (native){c[0], c[1]};
#endif
    } else {
        memcpy(&x, (const double *)codes + at, sizeof x);
    }
    return x;
}

/* As `spread`; a vector holds `each` samples. */
INLINE native native_spread(const double *w, int each)
{
#if NATIVE == 8
    return each == 1 ? (native)_mm512_set1_pd(*w) : (native)spread(w, NATIVE / each);
#elif NATIVE == 4
    return each == 1 ? (native)_mm256_set1_pd(*w) : (native){w[0], w[0], w[1], w[1]};
#else
    return (native){*w, *w};
#endif
}

INLINE native native_larger(native x, native y)
{
#if NATIVE == 8
    return (native)_mm512_max_pd((__m512d)x, (__m512d)y);
#elif NATIVE == 4
    return (native)_mm256_max_pd((__m256d)x, (__m256d)y);
#elif defined(__SSE2__)
    return (native)_mm_max_pd((__m128d)x, (__m128d)y);
#else
    return (native)(((x > y) & (native_mask)x) | (~(x > y) & (native_mask)y));
#endif
}

INLINE native native_smaller(native x, native y)
{
#if NATIVE == 8
    return (native)_mm512_min_pd((__m512d)x, (__m512d)y);
#elif NATIVE == 4
    return (native)_mm256_min_pd((__m256d)x, (__m256d)y);
#elif defined(__SSE2__)
    return (native)_mm_min_pd((__m128d)x, (__m128d)y);
#else
    return (native)(((x < y) & (native_mask)x) | (~(x < y) & (native_mask)y));
#endif
}

INLINE native native_swapped(native x)
{
#if NATIVE == 8
    return (native)_mm512_permute_pd((__m512d)x, 0x55);
#elif NATIVE == 4
    return (native)_mm256_permute_pd((__m256d)x, 5);
#else
    return __builtin_shuffle(x, (native_mask){1, 0});
#endif
}

/* Part `p` of a vector. */
INLINE native lanes(const vec *v, int p)
{
    native x;
    memcpy(&x, (const double *)v + NATIVE * p, sizeof x);
    return x;
}

INLINE void set_lanes(vec *v, int p, native x)
{
    memcpy((double *)v + NATIVE * p, &x, sizeof x);
}

#endif
