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

/* tanh(x) = x P(x^2)/Q(x^2), fitted over |x| <= 7.9 for the least largest error; beyond, tanh is 1 to 3e-7. In float32
 * the error stays below 4e-7. A NaN stays one. */
GROUSER_INLINE grouser_lanes lanes_tanh(grouser_lanes x) {
  const grouser_lanes most = lanes_of(7.9f), least = lanes_of(-7.9f);
  x = lanes_where_less(x, least, least, x);
  x = lanes_where_less(most, x, most, x);
  const grouser_lanes s = x * x;
  grouser_lanes p = lanes_of(2.4102732720e-11f), q = lanes_of(2.3808371168e-4f);
  p = lanes_fma(p, s, lanes_of(-1.4905462301e-8f));
  q = lanes_fma(q, s, lanes_of(2.4053006430e-2f));
  p = lanes_fma(p, s, lanes_of(9.9389674188e-6f));
  q = lanes_fma(q, s, lanes_of(4.6318207938e-1f));
  p = lanes_fma(p, s, lanes_of(2.9920753904e-3f));
  q = lanes_fma(q, s, lanes_of(1.0f));
  p = lanes_fma(p, s, lanes_of(1.2984890047e-1f));
  p = lanes_fma(p, s, lanes_of(9.9999998308e-1f));
  return x * p / q;
}

#endif
