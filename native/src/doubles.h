/* Vectors of doubles as wide as the level that a file is compiled for; a lone double where the compiler has none, or
 * where GROUSER_SCALAR asks for it. No operation rounds otherwise than that of a lone double. */
#ifndef GROUSER_DOUBLES_H
#define GROUSER_DOUBLES_H

#include <math.h>
#include <stdint.h>
#include <string.h>

#include "lanes.h"

/* Masks of every lane: without one, some compilers warn of what an operation leaves undefined before it writes. */
#define GROUSER_EVERY 0xff
#define GROUSER_EVERY_FLOAT 0xffff

#if defined(__GNUC__) && !defined(GROUSER_SCALAR)
#if defined(__AVX512F__)
enum { GROUSER_DOUBLES = 8 };
typedef double grouser_doubles __attribute__((vector_size(64)));
typedef uint64_t grouser_longs __attribute__((vector_size(64)));
#elif defined(__AVX2__) && defined(__FMA__)
enum { GROUSER_DOUBLES = 4 };
typedef double grouser_doubles __attribute__((vector_size(32)));
typedef uint64_t grouser_longs __attribute__((vector_size(32)));
#else
enum { GROUSER_DOUBLES = 2 };
typedef double grouser_doubles __attribute__((vector_size(16)));
typedef uint64_t grouser_longs __attribute__((vector_size(16)));
#endif
#else
enum { GROUSER_DOUBLES = 1 };
typedef double grouser_doubles;
typedef uint64_t grouser_longs;
#endif

/* Before an array that is read and written in vectors. */
#if defined(__GNUC__) /* whatever the width */
#define GROUSER_ALIGNED __attribute__((aligned(64)))
#else
#define GROUSER_ALIGNED
#endif

GROUSER_INLINE grouser_doubles doubles_load(const double *from) {
  grouser_doubles a;
  memcpy(&a, from, sizeof a);
  return a;
}

GROUSER_INLINE void doubles_store(double *to, grouser_doubles a) { memcpy(to, &a, sizeof a); }

GROUSER_INLINE grouser_doubles doubles_of(double value) {
#if defined(__GNUC__) && !defined(GROUSER_SCALAR)
#if defined(__AVX512F__)
  return (grouser_doubles)_mm512_set1_pd(value);
#elif defined(__AVX2__) && defined(__FMA__)
  return (grouser_doubles)_mm256_set1_pd(value);
#else
  const grouser_doubles a = {value, value};
  return a;
#endif
#else
  return value;
#endif
}

GROUSER_INLINE grouser_longs doubles_bits(grouser_doubles a) {
  grouser_longs bits;
  memcpy(&bits, &a, sizeof bits);
  return bits;
}

GROUSER_INLINE grouser_doubles doubles_from_bits(grouser_longs bits) {
  grouser_doubles a;
  memcpy(&a, &bits, sizeof a);
  return a;
}

/* a where below < above, else b; a NaN among them chooses b. */
GROUSER_INLINE grouser_doubles doubles_where_less(grouser_doubles below, grouser_doubles above, grouser_doubles a,
                                                  grouser_doubles b) {
#if defined(__GNUC__) && !defined(GROUSER_SCALAR)
#if defined(__AVX512F__)
  return (grouser_doubles)_mm512_mask_blend_pd(
      _mm512_cmp_pd_mask((__m512d)below, (__m512d)above, _CMP_LT_OQ), (__m512d)b, (__m512d)a);
#else
  const grouser_longs chosen = (grouser_longs)(below < above);
  return doubles_from_bits((chosen & doubles_bits(a)) | (~chosen & doubles_bits(b)));
#endif
#else
  return below < above ? a : b;
#endif
}

/* The lesser, or the greater; b where there is a NaN. */
GROUSER_INLINE grouser_doubles doubles_least(grouser_doubles a, grouser_doubles b) {
#if defined(__GNUC__) && !defined(GROUSER_SCALAR) && defined(__AVX512F__)
  return (grouser_doubles)_mm512_maskz_min_pd(GROUSER_EVERY, (__m512d)a, (__m512d)b);
#elif defined(__GNUC__) && !defined(GROUSER_SCALAR) && defined(__AVX2__) && defined(__FMA__)
  return (grouser_doubles)_mm256_min_pd((__m256d)a, (__m256d)b);
#else
  return doubles_where_less(a, b, a, b);
#endif
}

GROUSER_INLINE grouser_doubles doubles_most(grouser_doubles a, grouser_doubles b) {
#if defined(__GNUC__) && !defined(GROUSER_SCALAR) && defined(__AVX512F__)
  return (grouser_doubles)_mm512_maskz_max_pd(GROUSER_EVERY, (__m512d)a, (__m512d)b);
#elif defined(__GNUC__) && !defined(GROUSER_SCALAR) && defined(__AVX2__) && defined(__FMA__)
  return (grouser_doubles)_mm256_max_pd((__m256d)a, (__m256d)b);
#else
  return doubles_where_less(b, a, a, b);
#endif
}

GROUSER_INLINE grouser_doubles doubles_root(grouser_doubles a) {
#if defined(__GNUC__) && !defined(GROUSER_SCALAR) && defined(__AVX512F__)
  return (grouser_doubles)_mm512_maskz_sqrt_pd(GROUSER_EVERY, (__m512d)a);
#elif defined(__GNUC__) && !defined(GROUSER_SCALAR) && defined(__AVX2__) && defined(__FMA__)
  return (grouser_doubles)_mm256_sqrt_pd((__m256d)a);
#else
  double lane[GROUSER_DOUBLES];
  doubles_store(lane, a);
  for (int l = 0; l < GROUSER_DOUBLES; l++) lane[l] = sqrt(lane[l]);
  return doubles_load(lane);
#endif
}

/* 0, 1, 2, ... and the first of them added. */
GROUSER_INLINE grouser_doubles doubles_counted_from(int first) {
  static const double COUNT[] = {0, 1, 2, 3, 4, 5, 6, 7};
  return doubles_of(first) + doubles_load(COUNT);
}

#endif
