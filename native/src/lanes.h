/* Vectors of floats as wide as the level that a file is compiled for; a lone float where the compiler has none. */
#ifndef GROUSER_LANES_H
#define GROUSER_LANES_H

#include <stdint.h>
#include <string.h>

#if defined(__GNUC__)
#if defined(__AVX512F__)
#include <immintrin.h>
enum { GROUSER_FLOATS = 16 };
typedef float grouser_lanes __attribute__((vector_size(64)));
typedef int32_t grouser_bits __attribute__((vector_size(64)));
#elif defined(__AVX2__) && defined(__FMA__)
#include <immintrin.h>
enum { GROUSER_FLOATS = 8 };
typedef float grouser_lanes __attribute__((vector_size(32)));
typedef int32_t grouser_bits __attribute__((vector_size(32)));
#else
enum { GROUSER_FLOATS = 4 };
typedef float grouser_lanes __attribute__((vector_size(16)));
typedef int32_t grouser_bits __attribute__((vector_size(16)));
#endif
#define GROUSER_INLINE static inline __attribute__((always_inline))
#else
enum { GROUSER_FLOATS = 1 };
typedef float grouser_lanes;
typedef int32_t grouser_bits;
#define GROUSER_INLINE static inline
#endif

/* Before a loop over a handful of vectors that are to stay in registers. */
#if defined(__clang__)
#define GROUSER_UNROLL _Pragma("clang loop unroll(full)")
#elif defined(__GNUC__)
#define GROUSER_UNROLL _Pragma("GCC unroll 16")
#else
#define GROUSER_UNROLL
#endif

GROUSER_INLINE grouser_lanes lanes_load(const float *from) {
  grouser_lanes a;
  memcpy(&a, from, sizeof a);
  return a;
}

GROUSER_INLINE void lanes_store(float *to, grouser_lanes a) { memcpy(to, &a, sizeof a); }

GROUSER_INLINE grouser_lanes lanes_of(float value) {
#if defined(__AVX512F__)
  return (grouser_lanes)_mm512_set1_ps(value);
#elif defined(__AVX2__) && defined(__FMA__)
  return (grouser_lanes)_mm256_set1_ps(value);
#elif defined(__GNUC__)
  const grouser_lanes a = {value, value, value, value};
  return a;
#else
  return value;
#endif
}

/* a b + c, rounded once where the level has it. */
GROUSER_INLINE grouser_lanes lanes_fma(grouser_lanes a, grouser_lanes b, grouser_lanes c) {
#if defined(__AVX512F__)
  return (grouser_lanes)_mm512_fmadd_ps((__m512)a, (__m512)b, (__m512)c);
#elif defined(__AVX2__) && defined(__FMA__)
  return (grouser_lanes)_mm256_fmadd_ps((__m256)a, (__m256)b, (__m256)c);
#else
  return a * b + c;
#endif
}

GROUSER_INLINE grouser_bits lanes_bits(grouser_lanes a) {
  grouser_bits bits;
  memcpy(&bits, &a, sizeof bits);
  return bits;
}

GROUSER_INLINE grouser_lanes lanes_from_bits(grouser_bits bits) {
  grouser_lanes a;
  memcpy(&a, &bits, sizeof a);
  return a;
}

/* a where below < above, else b; a NaN among them chooses b. */
GROUSER_INLINE grouser_lanes lanes_where_less(grouser_lanes below, grouser_lanes above, grouser_lanes a,
                                              grouser_lanes b) {
#if defined(__GNUC__)
  const grouser_bits chosen = below < above;
  return lanes_from_bits((chosen & lanes_bits(a)) | (~chosen & lanes_bits(b)));
#else
  return below < above ? a : b;
#endif
}

/* exp(x) to a few units in the last place, without branches: x = k ln 2 + r, then 2^k times a Taylor sum in r. */
GROUSER_INLINE grouser_lanes lanes_exp(grouser_lanes x) {
  const grouser_lanes shift = lanes_of(12582912.0f); /* 1.5 * 2^23 */
  x = lanes_where_less(x, lanes_of(-87.0f), lanes_of(-87.0f), x);
  x = lanes_where_less(lanes_of(88.0f), x, lanes_of(88.0f), x);
  const grouser_lanes shifted = lanes_fma(x, lanes_of(1.44269504f), shift);
  const grouser_lanes k = shifted - shift;
  grouser_lanes r = lanes_fma(k, lanes_of(-0.693359375f), x);
  r = lanes_fma(k, lanes_of(2.12194440e-4f), r);
  grouser_lanes p = lanes_of(1.0f / 5040.0f);
  p = lanes_fma(p, r, lanes_of(1.0f / 720.0f));
  p = lanes_fma(p, r, lanes_of(1.0f / 120.0f));
  p = lanes_fma(p, r, lanes_of(1.0f / 24.0f));
  p = lanes_fma(p, r, lanes_of(1.0f / 6.0f));
  p = lanes_fma(p, r, lanes_of(0.5f));
  p = lanes_fma(p * r, r, r);
  const grouser_lanes scale = lanes_from_bits((lanes_bits(shifted) + 127) << 23);
  return lanes_fma(scale, p, scale);
}

#endif
