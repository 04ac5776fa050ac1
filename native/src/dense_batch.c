#include <stddef.h>

#include "grouser/dense.h"
#include "lanes.h"

/* Many samples side by side, vectors of samples instead of outputs. It goes on from the parts of dense.c, whose sums it
 * repeats in their order. */

/* A tile of out[o][..] = sum over i of weights[i][o] * in[i][..], with bias[o] added in the first `biased` vectors: one
 * broadcast weight serves `vectors` products, and the additions are those of affine_vectors. */
GROUSER_INLINE void tile(const float *weights, size_t stride, const float *bias, int biased, const float *in,
                         size_t columns, int inputs, float *out, const int outputs, const int vectors) {
  grouser_lanes even[SUMS / 2], odd[SUMS / 2];
  GROUSER_UNROLL
  for (int o = 0; o < outputs; o++)
    GROUSER_UNROLL
    for (int v = 0; v < vectors; v++) {
      even[o * vectors + v] = lanes_of(v < biased ? bias[o] : 0.0f);
      odd[o * vectors + v] = lanes_of(0.0f);
    }
  int i = 0;
  for (; i + 1 < inputs; i += 2) {
    const float *row = weights + (size_t)i * stride, *value = in + (size_t)i * columns;
    GROUSER_UNROLL
    for (int o = 0; o < outputs; o++) {
      const grouser_lanes first = lanes_of(row[o]), second = lanes_of(row[stride + (size_t)o]);
      GROUSER_UNROLL
      for (int v = 0; v < vectors; v++) {
        const int s = o * vectors + v;
        even[s] = lanes_fma(lanes_load(value + v * GROUSER_FLOATS), first, even[s]);
        odd[s] = lanes_fma(lanes_load(value + columns + v * GROUSER_FLOATS), second, odd[s]);
      }
    }
  }
  if (i < inputs)
    GROUSER_UNROLL
    for (int o = 0; o < outputs; o++) {
      const grouser_lanes last = lanes_of(weights[(size_t)i * stride + (size_t)o]);
      GROUSER_UNROLL
      for (int v = 0; v < vectors; v++)
        even[o * vectors + v] =
            lanes_fma(lanes_load(in + (size_t)i * columns + v * GROUSER_FLOATS), last, even[o * vectors + v]);
    }
  GROUSER_UNROLL
  for (int o = 0; o < outputs; o++)
    GROUSER_UNROLL
    for (int v = 0; v < vectors; v++)
      lanes_store(out + (size_t)o * columns + v * GROUSER_FLOATS, even[o * vectors + v] + odd[o * vectors + v]);
}

/* Tiles of `tall` outputs, a divisor of GROUSER_PANEL, by `wide` vectors, a divisor of the columns. */
GROUSER_INLINE void affine_columns(const float *weights, const float *bias, const float *in, int inputs, float *out,
                                   int outputs, int columns, int biased, const int tall, const int wide) {
  const size_t stride = (size_t)grouser_padded(outputs), row = (size_t)columns;
  for (int c = 0; c < columns; c += wide * GROUSER_FLOATS)
    for (int o = 0; o < outputs; o += tall)
      tile(weights + o, stride, bias + o, (biased - c) / GROUSER_FLOATS, in + c, row, inputs,
           out + (size_t)o * row + (size_t)c, tall, wide);
}

/* Half of the running sums of affine_few, of one vector of samples and a few outputs. */
enum { HALF = 8 };
typedef grouser_lanes running_sums[FEW][HALF];

GROUSER_INLINE void run_sums(const float *transposed, size_t padded, const float *in, size_t columns, int first,
                             int inputs, running_sums total, const int outputs) {
  grouser_lanes sum[FEW][HALF];
  GROUSER_UNROLL
  for (int o = 0; o < outputs; o++)
    GROUSER_UNROLL
    for (int s = 0; s < HALF; s++) sum[o][s] = lanes_of(0.0f);
  int i = first;
  for (; i + HALF <= inputs; i += 2 * HALF)
    GROUSER_UNROLL
    for (int s = 0; s < HALF; s++) {
      const grouser_lanes value = lanes_load(in + (size_t)(i + s) * columns);
      GROUSER_UNROLL
      for (int o = 0; o < outputs; o++)
        sum[o][s] = lanes_fma(value, lanes_of(transposed[(size_t)o * padded + (size_t)(i + s)]), sum[o][s]);
    }
  GROUSER_UNROLL
  for (int o = 0; o < outputs; o++)
    GROUSER_UNROLL
    for (int s = 0; s < HALF; s++) total[o][s] = sum[o][s];
  for (int s = 0; i + s < inputs; s++)
    for (int o = 0; o < outputs; o++)
      total[o][s] = lanes_fma(lanes_load(in + (size_t)(i + s) * columns),
                              lanes_of(transposed[(size_t)o * padded + (size_t)(i + s)]), total[o][s]);
}

GROUSER_INLINE void few_tile(const float *transposed, size_t padded, const float *bias, int biased, const float *in,
                             size_t columns, int inputs, float *out, const int outputs) {
  running_sums low, high;
  run_sums(transposed, padded, in, columns, 0, inputs, low, outputs);
  run_sums(transposed, padded, in, columns, HALF, inputs, high, outputs);
  for (int o = 0; o < outputs; o++) {
    for (int s = 0; s < HALF; s++) low[o][s] += high[o][s];
    for (int width = HALF / 2; width > 0; width /= 2)
      for (int s = 0; s < width; s++) low[o][s] += low[o][s + width];
    lanes_store(out + (size_t)o * columns, low[o][0] + lanes_of(biased ? bias[o] : 0.0f));
  }
}

/* affine_few of samples side by side. */
GROUSER_INLINE void few_columns(const float *transposed, const float *bias, const float *in, int inputs, float *out,
                                int outputs, int columns, int biased) {
  const size_t padded = (size_t)grouser_padded(inputs), row = (size_t)columns;
  for (int c = 0; c < columns; c += GROUSER_FLOATS) {
    int o = 0;
    /* As many as registers hold. */
    for (; GROUSER_FLOATS == 16 && o + GROUSER_OUTPUTS <= outputs; o += GROUSER_OUTPUTS)
      few_tile(transposed + (size_t)o * padded, padded, bias + o, c < biased, in + c, row, inputs, out + (size_t)o * row + c,
               GROUSER_OUTPUTS);
    for (; o < outputs; o++)
      few_tile(transposed + (size_t)o * padded, padded, bias + o, c < biased, in + c, row, inputs, out + (size_t)o * row + c,
               1);
  }
}

/* The duals of a block are one tile wide where a block is one vector. */
enum { WIDE = 2, DUAL_WIDE = GROUSER_FLOATS == 16 ? 4 : WIDE };

void grouser_dense_batch(const grouser_dense *net, const float *in, int count, float *out, float *scratch) {
  const int last = net->layers - 1, wide = WIDE * GROUSER_FLOATS;
  const float *value = in;
  for (int layer = 0; layer <= last; layer++) {
    const int inputs = net->widths[layer], outputs = net->widths[layer + 1];
    float *next = layer == last ? out : scratch + (size_t)(layer % 2) * (size_t)(net->widest * count);
    if (sums_along(net, layer))
      few_columns(net->transposed[layer], net->biases[layer], value, inputs, next, outputs, count, count);
    else if (count % wide == 0)
      affine_columns(net->weights[layer], net->biases[layer], value, inputs, next, outputs, count, count,
                     SUMS / 2 / WIDE, WIDE);
    else
      affine_columns(net->weights[layer], net->biases[layer], value, inputs, next, outputs, count, count,
                     SUMS / 2, 1);
    if (layer < last) activate_rows(net->activation, next, NULL, NULL, outputs * count, 1);
    value = next;
  }
}

GROUSER_INLINE void activate_duals(const enum grouser_activation kind, float *rows, int width) {
  for (int n = 0; n < width; n++)
    for (int l = 0; l < GROUSER_BLOCK; l += GROUSER_FLOATS) {
      float *row = rows + (size_t)n * GROUSER_DUAL + l;
      grouser_lanes slope;
      lanes_store(row, activated(kind, lanes_load(row), &slope));
      for (int d = 1; d <= GROUSER_SEEDS; d++)
        lanes_store(row + d * GROUSER_BLOCK, slope * lanes_load(row + d * GROUSER_BLOCK));
    }
}

void grouser_dense_block(const grouser_dense *net, const float *in, float *out, float *scratch) {
  const int last = net->layers - 1;
  const float *value = in;
  for (int layer = 0; layer <= last; layer++) {
    const int width = net->widths[layer + 1];
    float *next = layer == last ? out : scratch + (size_t)(layer % 2) * (size_t)(net->widest * GROUSER_DUAL);
    if (sums_along(net, layer))
      few_columns(net->transposed[layer], net->biases[layer], value, net->widths[layer], next, width, GROUSER_DUAL,
                  GROUSER_BLOCK);
    else
      affine_columns(net->weights[layer], net->biases[layer], value, net->widths[layer], next, width, GROUSER_DUAL,
                     GROUSER_BLOCK, SUMS / 2 / DUAL_WIDE, DUAL_WIDE);
    if (layer < last) {
      if (net->activation == GROUSER_RELU)
        activate_duals(GROUSER_RELU, next, width);
      else if (net->activation == GROUSER_SILU)
        activate_duals(GROUSER_SILU, next, width);
      else
        activate_duals(GROUSER_TANH, next, width);
    }
    value = next;
  }
}
