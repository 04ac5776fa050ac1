#include "network.h"

enum { SKIP = 0, PER_WORD = 2 };
typedef __m512 sums;

INLINE sums no_sum(void) { return _mm512_setzero_ps(); }
INLINE sums both(sums a, sums b) { return _mm512_add_ps(a, b); }
INLINE __m512 number(sums a) { return a; }
INLINE sums dot(sums sum, __m512i value, __m512i weights) {
  return _mm512_dpbf16_ps(sum, (__m512bh)value, (__m512bh)weights);
}
INLINE __m512 scale_of(const layer *by, int at, float unit) {
  (void)by, (void)at;
  return _mm512_set1_ps(unit);
}

/* Pairs of activations; a width is padded to whole vectors, so that a pair of them may lie beyond it. */
INLINE float pack(const float *in, int inputs, int32_t *words) {
  for (int i = 0; i < inputs; i += LANES)
    _mm256_store_si256((__m256i *)(words + i / PER_WORD), (__m256i)_mm512_cvtneps_pbh(_mm512_load_ps(in + i)));
  return 1.0f;
}

#include "dot.h"
