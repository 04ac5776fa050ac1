/* The first layer in float32; behind it, several inputs of an output side by side in one 32-bit word, multiplied and added by
 * one instruction. Whoever includes this says which: words of activations, sums, and what a sum stands for. */
#ifndef DOT_H
#define DOT_H

#include "network.h"

typedef float weight;

INLINE __m512 widened(const weight *from) { return _mm512_load_ps(from); }

#include "panels.h"

INLINE void dot_panel(const layer *by, const int32_t *words, int count, float unit, float *out, int done, int rectified,
                      const int vectors, const int chains) {
  sums sum[LANES];
  const size_t stride = (size_t)by->outputs;
  const int32_t *weights = (const int32_t *)by->weights + done;
  UNROLL
  for (int s = 0; s < vectors * chains; s++) sum[s] = no_sum();
  int n = 0;
  for (; n + chains <= count; n += chains)
    UNROLL
    for (int c = 0; c < chains; c++) {
      const __m512i value = _mm512_set1_epi32(words[n + c]);
      UNROLL
      for (int v = 0; v < vectors; v++)
        sum[c * vectors + v] = dot(sum[c * vectors + v], value,
                                   _mm512_load_si512(weights + (size_t)(n + c) * stride + LANES * v));
    }
  for (; n < count; n++)
    UNROLL
    for (int v = 0; v < vectors; v++)
      sum[v] = dot(sum[v], _mm512_set1_epi32(words[n]), _mm512_load_si512(weights + (size_t)n * stride + LANES * v));
  UNROLL
  for (int v = 0; v < vectors; v++) {
    sums total = sum[v];
    UNROLL
    for (int c = 1; c < chains; c++) total = both(total, sum[c * vectors + v]);
    const int at = done + LANES * v;
    const __m512 result = _mm512_fmadd_ps(number(total), scale_of(by, at, unit), _mm512_load_ps(by->biases + at));
    _mm512_store_ps(out + at, rectified ? _mm512_max_ps(result, _mm512_setzero_ps()) : result);
  }
}

static void affine(int index, const float *in, float *out, int rectified) {
  const layer *by = &net.at[index];
  if (index == 0) {
    panels(by, in, NULL, by->inputs, out, rectified);
    return;
  }
  _Alignas(64) int32_t words[MOST_WIDTH];
  const int count = (by->inputs + PER_WORD - 1) / PER_WORD;
  const float unit = pack(in, by->inputs, words);
  int done = 0;
  for (; done + 8 * LANES <= by->outputs; done += 8 * LANES)
    dot_panel(by, words, count, unit, out, done, rectified, 8, 2);
  for (; done + 4 * LANES <= by->outputs; done += 4 * LANES)
    dot_panel(by, words, count, unit, out, done, rectified, 4, 2);
  for (; done < by->outputs; done += LANES) dot_panel(by, words, count, unit, out, done, rectified, 1, 8);
}

#endif
