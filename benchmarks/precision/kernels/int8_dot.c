#include "network.h"

enum { SKIP = 0, PER_WORD = 4 };
typedef __m512i sums;

INLINE sums no_sum(void) { return _mm512_setzero_si512(); }
INLINE sums both(sums a, sums b) { return _mm512_add_epi32(a, b); }
INLINE __m512 number(sums a) { return _mm512_cvtepi32_ps(a); }
INLINE sums dot(sums sum, __m512i value, __m512i weights) { return _mm512_dpbusd_epi32(sum, value, weights); }
INLINE __m512 scale_of(const layer *by, int at, float unit) {
  return _mm512_mul_ps(_mm512_load_ps(by->scales + at), _mm512_set1_ps(unit));
}

/* Fours of activations as unsigned bytes, the largest of all being 255; returns what one is worth. */
INLINE float pack(const float *in, int inputs, int32_t *words) {
  __m512 most = _mm512_setzero_ps();
  for (int i = 0; i < inputs; i += LANES) most = _mm512_max_ps(most, _mm512_load_ps(in + i));
  const float largest = _mm512_reduce_max_ps(most), least = 255.0f * 1.17549435e-38f;
  const float unit = largest < least ? 1.0f : largest / 255.0f;
  const __m512 factor = _mm512_set1_ps(1.0f / unit);
  for (int i = 0; i < inputs; i += LANES) {
    const __m512i codes = _mm512_cvtps_epi32(_mm512_mul_ps(_mm512_load_ps(in + i), factor));
    _mm_store_si128((__m128i *)(words + i / PER_WORD), _mm512_cvtusepi32_epi8(codes));
  }
  return unit;
}

#include "dot.h"
