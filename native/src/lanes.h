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

/* a where below < above, else b; a NaN among them chooses b. */
GROUSER_INLINE grouser_lanes lanes_where_less(grouser_lanes below, grouser_lanes above, grouser_lanes a,
                                              grouser_lanes b) {
#if defined(__AVX512F__)
  return (grouser_lanes)_mm512_mask_blend_ps(_mm512_cmp_ps_mask((__m512)below, (__m512)above, _CMP_LT_OQ), (__m512)b,
                                             (__m512)a);
#elif defined(__GNUC__)
  const grouser_bits chosen = below < above;
  return (grouser_lanes)((chosen & (grouser_bits)a) | (~chosen & (grouser_bits)b));
#else
  return below < above ? a : b;
#endif
}

/* A bit for each lane that is not zero, which a NaN is not. */
GROUSER_INLINE unsigned lanes_not_zero(grouser_lanes a) {
#if defined(__AVX512F__)
  return _mm512_cmp_ps_mask((__m512)a, _mm512_setzero_ps(), _CMP_NEQ_UQ);
#elif defined(__AVX2__) && defined(__FMA__)
  return (unsigned)_mm256_movemask_ps(_mm256_cmp_ps((__m256)a, _mm256_setzero_ps(), _CMP_NEQ_UQ));
#else
  float each[GROUSER_FLOATS];
  unsigned bits = 0;
  memcpy(each, &a, sizeof a);
  for (int l = 0; l < GROUSER_FLOATS; l++) bits |= (unsigned)(each[l] != 0) << l;
  return bits;
#endif
}

/* The total of sixteen floats, halves first: j and j + 8, then j and j + 4, and so on. */
GROUSER_INLINE float lanes_sum(const grouser_lanes *sum) {
#if defined(__GNUC__)
  typedef float quad __attribute__((vector_size(16)));
  quad q;
#if defined(__AVX512F__)
  const __m256 half = _mm512_castps512_ps256((__m512)sum[0]) + _mm512_extractf32x8_ps((__m512)sum[0], 1);
  q = (quad)(_mm256_castps256_ps128(half) + _mm256_extractf128_ps(half, 1));
#elif defined(__AVX2__) && defined(__FMA__)
  const __m256 half = (__m256)(sum[0] + sum[1]);
  q = (quad)(_mm256_castps256_ps128(half) + _mm256_extractf128_ps(half, 1));
#else
  q = (sum[0] + sum[2]) + (sum[1] + sum[3]);
#endif
  return (q[0] + q[2]) + (q[1] + q[3]);
#else
  float half[8];
  for (int j = 0; j < 8; j++) half[j] = sum[j] + sum[j + 8];
  for (int width = 4; width > 0; width /= 2)
    for (int j = 0; j < width; j++) half[j] += half[j + width];
  return half[0];
#endif
}

/* x between two bounds; a NaN stays one. */
GROUSER_INLINE grouser_lanes lanes_clamp(grouser_lanes x, grouser_lanes least, grouser_lanes most) {
#if defined(__AVX512F__)
  return (grouser_lanes)_mm512_min_ps((__m512)most, _mm512_max_ps((__m512)least, (__m512)x));
#elif defined(__AVX2__) && defined(__FMA__)
  return (grouser_lanes)_mm256_min_ps((__m256)most, _mm256_max_ps((__m256)least, (__m256)x));
#else
  x = lanes_where_less(x, least, least, x);
  return lanes_where_less(most, x, most, x);
#endif
}

/* tanh(x) = x P(x^2)/Q(x^2), fitted over |x| <= 7.9 for the least largest error; beyond, tanh is 1 to 3e-7. In float32
 * the error stays below 4e-7. A NaN stays one. */
GROUSER_INLINE grouser_lanes lanes_tanh(grouser_lanes x) {
  x = lanes_clamp(x, lanes_of(-7.9f), lanes_of(7.9f));
  /* Pairs of terms do not wait for each other. */
  const grouser_lanes s = x * x, s2 = s * s;
  const grouser_lanes p0 = lanes_fma(lanes_of(1.2984890047e-1f), s, lanes_of(9.9999998308e-1f));
  const grouser_lanes p2 = lanes_fma(lanes_of(9.9389674188e-6f), s, lanes_of(2.9920753904e-3f));
  const grouser_lanes p4 = lanes_fma(lanes_of(2.4102732720e-11f), s, lanes_of(-1.4905462301e-8f));
  const grouser_lanes q0 = lanes_fma(lanes_of(4.6318207938e-1f), s, lanes_of(1.0f));
  const grouser_lanes q2 = lanes_fma(lanes_of(2.3808371168e-4f), s, lanes_of(2.4053006430e-2f));
  return x * lanes_fma(lanes_fma(p4, s2, p2), s2, p0) / lanes_fma(q2, s2, q0);
}

#endif
