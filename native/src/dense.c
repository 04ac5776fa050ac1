#include "grouser/dense.h"

#include <stddef.h>
#include <string.h>

#include "lanes.h"

/* How many vectors of sums stay in registers. */
enum { SUMS = GROUSER_FLOATS == 16 ? 16 : 8 };

/* One input at a time against a row of outputs, even and odd inputs in sums of their own: half the wait for each
 * other, and the same additions at every number of vectors. `rows` inputs, GROUSER_MAX_WIDTH apart, share the weights;
 * the first of every `group` has the bias, the others are derivatives. */
GROUSER_INLINE void affine_vectors(const float *weights, size_t stride, const float *bias, const float *in, int inputs,
                                   float *out, const int rows, const int group, const int vectors) {
  grouser_lanes even[SUMS / 2], odd[SUMS / 2];
  GROUSER_UNROLL
  for (int s = 0; s < rows * vectors; s++) {
    even[s] = s / vectors % group == 0 ? lanes_load(bias + s % vectors * GROUSER_FLOATS) : lanes_of(0.0f);
    odd[s] = lanes_of(0.0f);
  }
  int i = 0;
  for (; i + 1 < inputs; i += 2) {
    const float *row = weights + (size_t)i * stride;
    GROUSER_UNROLL
    for (int v = 0; v < vectors; v++) {
      const grouser_lanes first = lanes_load(row + v * GROUSER_FLOATS);
      const grouser_lanes second = lanes_load(row + stride + v * GROUSER_FLOATS);
      GROUSER_UNROLL
      for (int r = 0; r < rows; r++) {
        const float *value = in + r * GROUSER_MAX_WIDTH + i;
        even[r * vectors + v] = lanes_fma(lanes_of(value[0]), first, even[r * vectors + v]);
        odd[r * vectors + v] = lanes_fma(lanes_of(value[1]), second, odd[r * vectors + v]);
      }
    }
  }
  if (i < inputs)
    GROUSER_UNROLL
    for (int s = 0; s < rows * vectors; s++)
      even[s] = lanes_fma(lanes_of(in[s / vectors * GROUSER_MAX_WIDTH + i]),
                          lanes_load(weights + (size_t)i * stride + s % vectors * GROUSER_FLOATS), even[s]);
  GROUSER_UNROLL
  for (int s = 0; s < rows * vectors; s++)
    lanes_store(out + s / vectors * GROUSER_MAX_WIDTH + s % vectors * GROUSER_FLOATS, even[s] + odd[s]);
}

/* Inputs that are not zero, even and odd ones apart. */
typedef struct {
  int even[GROUSER_MAX_WIDTH / 2 + 1], odd[GROUSER_MAX_WIDTH / 2 + 1], evens, odds;
} active_inputs;

static void find_active(const float *in, int inputs, active_inputs *active) {
  int evens = 0, odds = 0;
  for (int i = 0; i + 1 < inputs; i += 2) {
    active->even[evens] = i;
    evens += in[i] != 0;
    active->odd[odds] = i + 1;
    odds += in[i + 1] != 0;
  }
  if (inputs % 2) {
    active->even[evens] = inputs - 1;
    evens += in[inputs - 1] != 0;
  }
  active->evens = evens;
  active->odds = odds;
}

/* affine_vectors of one row without the inputs that are zero: the same sums to the bit, for half of the weights where
 * half of the units are silent. */
GROUSER_INLINE void active_vectors(const float *weights, size_t stride, const float *bias, const float *in,
                                   const active_inputs *active, float *out, const int vectors) {
  grouser_lanes even[SUMS], odd[SUMS];
  GROUSER_UNROLL
  for (int v = 0; v < vectors; v++) {
    even[v] = lanes_load(bias + v * GROUSER_FLOATS);
    odd[v] = lanes_of(0.0f);
  }
  for (int n = 0; n < active->evens; n++) {
    const int i = active->even[n];
    const float *row = weights + (size_t)i * stride;
    GROUSER_UNROLL
    for (int v = 0; v < vectors; v++) even[v] = lanes_fma(lanes_of(in[i]), lanes_load(row + v * GROUSER_FLOATS), even[v]);
  }
  for (int n = 0; n < active->odds; n++) {
    const int i = active->odd[n];
    const float *row = weights + (size_t)i * stride;
    GROUSER_UNROLL
    for (int v = 0; v < vectors; v++) odd[v] = lanes_fma(lanes_of(in[i]), lanes_load(row + v * GROUSER_FLOATS), odd[v]);
  }
  GROUSER_UNROLL
  for (int v = 0; v < vectors; v++) lanes_store(out + v * GROUSER_FLOATS, even[v] + odd[v]);
}

static void affine_active(const float *weights, const float *bias, const float *in, int inputs, float *out,
                          int outputs) {
  const int stride = grouser_padded(outputs);
  active_inputs active;
  int done = 0;
  find_active(in, inputs, &active);
  for (; done + 8 * GROUSER_FLOATS <= stride; done += 8 * GROUSER_FLOATS)
    active_vectors(weights + done, (size_t)stride, bias + done, in, &active, out + done, 8);
  for (; done + 4 * GROUSER_FLOATS <= stride; done += 4 * GROUSER_FLOATS)
    active_vectors(weights + done, (size_t)stride, bias + done, in, &active, out + done, 4);
  for (; done < stride; done += GROUSER_FLOATS)
    active_vectors(weights + done, (size_t)stride, bias + done, in, &active, out + done, 1);
}

GROUSER_INLINE void affine_rows(const float *weights, const float *bias, const float *in, int inputs, float *out,
                                int outputs, const int rows, const int group) {
  enum { MOST = SUMS / 2 };
  const int stride = grouser_padded(outputs), most = MOST / rows;
  int done = 0;
  for (; done + most * GROUSER_FLOATS <= stride; done += most * GROUSER_FLOATS)
    affine_vectors(weights + done, (size_t)stride, bias + done, in, inputs, out + done, rows, group, most);
  for (; done + 4 * GROUSER_FLOATS <= stride && most > 4; done += 4 * GROUSER_FLOATS)
    affine_vectors(weights + done, (size_t)stride, bias + done, in, inputs, out + done, rows, group, most > 4 ? 4 : 1);
  for (; done + 2 * GROUSER_FLOATS <= stride && most > 2; done += 2 * GROUSER_FLOATS)
    affine_vectors(weights + done, (size_t)stride, bias + done, in, inputs, out + done, rows, group, most > 2 ? 2 : 1);
  for (; done < stride; done += GROUSER_FLOATS)
    affine_vectors(weights + done, (size_t)stride, bias + done, in, inputs, out + done, rows, group, 1);
}

/* The activation of z, and its derivative. A NaN stays one. */
GROUSER_INLINE grouser_lanes activated(enum grouser_activation kind, grouser_lanes z, grouser_lanes *slope) {
  const grouser_lanes one = lanes_of(1.0f), zero = lanes_of(0.0f);
  if (kind == GROUSER_RELU) {
    *slope = lanes_where_less(zero, z, one, zero);
    return lanes_where_less(z, zero, zero, z);
  }
  if (kind == GROUSER_SILU) {
    const grouser_lanes half = lanes_of(0.5f), gate = lanes_fma(half, lanes_tanh(half * z), half);
    *slope = gate * lanes_fma(z, one - gate, one);
    return z * gate;
  }
  const grouser_lanes t = lanes_tanh(z);
  *slope = one - t * t;
  return t;
}

/* Overwrites z by its activations, in one row or two that do not wait for each other; slopes may be NULL. */
GROUSER_INLINE void activate_as(const enum grouser_activation kind, float *value, float *first, float *second, int count,
                                const int rows) {
  grouser_lanes by[2];
  for (int n = 0; n < count; n += GROUSER_FLOATS) {
    GROUSER_UNROLL
    for (int r = 0; r < rows; r++) {
      float *at = value + r * GROUSER_MAX_WIDTH + n;
      lanes_store(at, activated(kind, lanes_load(at), &by[r]));
    }
    if (first) lanes_store(first + n, by[0]);
    if (rows > 1 && second) lanes_store(second + n, by[1]);
  }
}

GROUSER_INLINE void activate_rows(enum grouser_activation kind, float *value, float *first, float *second, int count,
                                  const int rows) {
  if (kind == GROUSER_RELU)
    activate_as(GROUSER_RELU, value, first, second, count, rows);
  else if (kind == GROUSER_SILU)
    activate_as(GROUSER_SILU, value, first, second, count, rows);
  else
    activate_as(GROUSER_TANH, value, first, second, count, rows);
}

GROUSER_INLINE void forward_rows(const grouser_dense *net, const float *inputs, float *outputs,
                                 grouser_slopes *const slopes, const int rows) {
  float buffer[2][2 * GROUSER_MAX_WIDTH];
  const float *value = inputs;
  const int last = net->layers - 1;
  for (int layer = 0; layer < last; layer++) {
    const int width = net->widths[layer + 1];
    float *next = buffer[layer % 2];
    if (rows == 1 && layer > 0 && net->activation == GROUSER_RELU)
      affine_active(net->weights[layer], net->biases[layer], value, net->widths[layer], next, width);
    else
      affine_rows(net->weights[layer], net->biases[layer], value, net->widths[layer], next, width, rows, 1);
    activate_rows(net->activation, next, slopes ? slopes[0][layer] : NULL, slopes && rows > 1 ? slopes[1][layer] : NULL,
                  grouser_padded(width), rows);
    value = next;
  }
  affine_rows(net->weights[last], net->biases[last], value, net->widths[last], outputs, net->widths[net->layers], rows, 1);
}

void grouser_dense_forward(const grouser_dense *net, const float *inputs, float *outputs, grouser_slopes *slopes) {
  forward_rows(net, inputs, outputs, slopes, 1);
}

void grouser_dense_forward_pair(const grouser_dense *net, const float *inputs, float *outputs, grouser_slopes *slopes) {
  forward_rows(net, inputs, outputs, slopes, 2);
}

enum { DUAL_ROWS = 1 + GROUSER_SEEDS };

void grouser_dense_dual(const grouser_dense *net, const float *in, float *out) {
  float buffer[2][DUAL_ROWS * GROUSER_MAX_WIDTH];
  const float *value = in;
  const int last = net->layers - 1;
  for (int layer = 0; layer <= last; layer++) {
    const int width = net->widths[layer + 1];
    float *next = layer == last ? out : buffer[layer % 2];
    affine_rows(net->weights[layer], net->biases[layer], value, net->widths[layer], next, width, DUAL_ROWS, DUAL_ROWS);
    for (int n = 0; layer < last && n < grouser_padded(width); n += GROUSER_FLOATS) {
      grouser_lanes slope;
      lanes_store(next + n, activated(net->activation, lanes_load(next + n), &slope));
      for (int d = 1; d < DUAL_ROWS; d++) {
        float *by = next + d * GROUSER_MAX_WIDTH + n;
        lanes_store(by, slope * lanes_load(by));
      }
    }
    value = next;
  }
}

/* The seeds share every load of a weight. */
GROUSER_INLINE void backward_vectors(const float *weights, size_t stride, const float *from, int inputs, float *to,
                                     const int vectors) {
  grouser_lanes sum[GROUSER_SEEDS][4];
  GROUSER_UNROLL
  for (int n = 0; n < GROUSER_SEEDS; n++)
    GROUSER_UNROLL
    for (int v = 0; v < vectors; v++) sum[n][v] = lanes_of(0.0f);
  for (int i = 0; i < inputs; i++) {
    const float *row = weights + (size_t)i * stride;
    GROUSER_UNROLL
    for (int v = 0; v < vectors; v++) {
      const grouser_lanes weight = lanes_load(row + v * GROUSER_FLOATS);
      GROUSER_UNROLL
      for (int n = 0; n < GROUSER_SEEDS; n++)
        sum[n][v] = lanes_fma(lanes_of(from[n * GROUSER_MAX_WIDTH + i]), weight, sum[n][v]);
    }
  }
  GROUSER_UNROLL
  for (int n = 0; n < GROUSER_SEEDS; n++)
    GROUSER_UNROLL
    for (int v = 0; v < vectors; v++) lanes_store(to + n * GROUSER_MAX_WIDTH + v * GROUSER_FLOATS, sum[n][v]);
}

void grouser_dense_backward(const grouser_dense *net, grouser_slopes slopes,
                            float rows[GROUSER_SEEDS * GROUSER_MAX_WIDTH]) {
  float back[GROUSER_SEEDS * GROUSER_MAX_WIDTH];
  float *from = rows, *to = back;
  for (int layer = net->layers - 1; layer >= 0; layer--) {
    const int inputs = net->widths[layer + 1], padded = grouser_padded(net->widths[layer]);
    int done = 0;
    for (; done + 4 * GROUSER_FLOATS <= padded; done += 4 * GROUSER_FLOATS)
      backward_vectors(net->transposed[layer] + done, (size_t)padded, from, inputs, to + done, 4);
    for (; done < padded; done += GROUSER_FLOATS)
      backward_vectors(net->transposed[layer] + done, (size_t)padded, from, inputs, to + done, 1);
    for (int n = 0; layer > 0 && n < GROUSER_SEEDS; n++)
      for (int i = 0; i < padded; i++) to[n * GROUSER_MAX_WIDTH + i] *= slopes[layer - 1][i];
    float *const swap = from;
    from = to;
    to = swap;
  }
  if (from != rows) memcpy(rows, back, sizeof back);
}
