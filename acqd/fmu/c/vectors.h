/* Whether lanes are vectors, and whether they are compiled for AVX2, too. */
#ifndef ACQD_VECTORS_H
#define ACQD_VECTORS_H

/* Rounding by a magic number needs sums in the order in which they are written. */
#if defined(__GNUC__) && !defined(ACQD_ONE_LANE) && !defined(__FAST_MATH__) && !defined(__ASSOCIATIVE_MATH__)
#define VECTORS 1
#else
#define VECTORS 0
#endif

/* GCC for Windows does not align 32 bytes on the stack (GCC bug 54412); clang does. */
#if VECTORS && defined(__x86_64__) && (defined(__clang__) || !defined(_WIN32))
#define WITH_AVX2 1
#else
#define WITH_AVX2 0
#endif

#endif
