/* Vectors of as many numbers as the processor takes at once: compilers take operations on wider ones apart. */

#ifndef ACQD_VECTORS_H
#define ACQD_VECTORS_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>
#ifdef __SSE2__
#include <immintrin.h>
#endif

#define LANES 8 /* of the widest vectors */
#define INLINE static inline __attribute__((always_inline))

#if defined(__AVX512F__)
#define NATIVE 8
#elif defined(__AVX2__)
#define NATIVE 4
#else
#define NATIVE 2
#endif
typedef double native __attribute__((vector_size(8 * NATIVE)));
typedef long long native_mask __attribute__((vector_size(8 * NATIVE)));
typedef int32_t native_ints __attribute__((vector_size(8 * NATIVE)));
typedef uint32_t native_uints __attribute__((vector_size(8 * NATIVE)));

INLINE native at(const double *x)
{
    native v;
    memcpy(&v, x, sizeof v);
    return v;
}

INLINE double total(native v)
{
    double sum = 0;
    for (int lane = 0; lane < NATIVE; lane++)
        sum += v[lane];
    return sum;
}

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

#endif
