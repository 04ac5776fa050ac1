/* One broadcast input at a time against rows of outputs, in several sums that do not wait for each other. Whoever includes
 * this says what a weight is and how sixteen of them become floats. */
#ifndef PANELS_H
#define PANELS_H

#include "network.h"

/* `places` lists the inputs that are read, NULL for all of them in turn. */
INLINE void panel(const layer *by, const float *in, const int *places, int count, float *out, int done, int rectified,
                  const int vectors, const int chains) {
  __m512 sum[LANES];
  const size_t stride = (size_t)by->outputs;
  const weight *weights = (const weight *)by->weights + done;
  UNROLL
  for (int s = 0; s < vectors * chains; s++) sum[s] = _mm512_setzero_ps();
  int n = 0;
  for (; n + chains <= count; n += chains)
    UNROLL
    for (int c = 0; c < chains; c++) {
      const int i = places ? places[n + c] : n + c;
      const __m512 value = _mm512_set1_ps(in[i]);
      UNROLL
      for (int v = 0; v < vectors; v++)
        sum[c * vectors + v] =
            _mm512_fmadd_ps(value, widened(weights + (size_t)i * stride + LANES * v), sum[c * vectors + v]);
    }
  for (; n < count; n++) {
    const int i = places ? places[n] : n;
    UNROLL
    for (int v = 0; v < vectors; v++)
      sum[v] = _mm512_fmadd_ps(_mm512_set1_ps(in[i]), widened(weights + (size_t)i * stride + LANES * v), sum[v]);
  }
  UNROLL
  for (int v = 0; v < vectors; v++) {
    __m512 total = sum[v];
    UNROLL
    for (int c = 1; c < chains; c++) total = _mm512_add_ps(total, sum[c * vectors + v]);
    const int at = done + LANES * v;
    const __m512 bias = _mm512_load_ps(by->biases + at);
    total = by->scales ? _mm512_fmadd_ps(total, _mm512_load_ps(by->scales + at), bias) : _mm512_add_ps(total, bias);
    _mm512_store_ps(out + at, rectified ? _mm512_max_ps(total, _mm512_setzero_ps()) : total);
  }
}

INLINE void panels(const layer *by, const float *in, const int *places, int count, float *out, int rectified) {
  int done = 0;
  for (; done + 8 * LANES <= by->outputs; done += 8 * LANES) panel(by, in, places, count, out, done, rectified, 8, 2);
  for (; done + 4 * LANES <= by->outputs; done += 4 * LANES) panel(by, in, places, count, out, done, rectified, 4, 2);
  for (; done < by->outputs; done += LANES) panel(by, in, places, count, out, done, rectified, 1, 8);
}

/* Lists the inputs that are not zero, and returns how many there are. Hidden layers are padded with zeros. */
INLINE int find_active(const float *in, int inputs, int *places) {
  int count = 0;
  __m512i at = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
  for (int i = 0; i < inputs; i += LANES) {
    const __mmask16 active = _mm512_cmp_ps_mask(_mm512_load_ps(in + i), _mm512_setzero_ps(), _CMP_NEQ_UQ);
    _mm512_storeu_si512(places + count, _mm512_maskz_compress_epi32(active, at));
    count += __builtin_popcount(active);
    at = _mm512_add_epi32(at, _mm512_set1_epi32(LANES));
  }
  return count;
}

INLINE void widening_affine(int index, const float *in, float *out, int rectified) {
  const layer *by = &net.at[index];
  int places[MOST_WIDTH + LANES];
  if (SKIP && index > 0)
    panels(by, in, places, find_active(in, by->inputs, places), out, rectified);
  else
    panels(by, in, NULL, by->inputs, out, rectified);
}

#endif
