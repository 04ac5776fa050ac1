#include "grouser/dense.h"

#include <stddef.h>
#include <stdint.h>
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

/* A bit for each input that is not zero, in words of BITS inputs. */
enum { BITS = 64 };
typedef uint64_t active_inputs[(GROUSER_MAX_WIDTH + BITS - 1) / BITS];

static const uint64_t EVEN = 0x5555555555555555u;

/* Takes the lowest bit out of a word that is not zero, and returns its number. */
GROUSER_INLINE int take_bit(uint64_t *word) {
#if defined(__GNUC__)
  const int bit = __builtin_ctzll(*word);
#else
  int bit = 0;
  while (!(*word >> bit & 1)) bit++;
#endif
  *word &= *word - 1;
  return bit;
}

static void all_active(int count, active_inputs active) {
  for (int w = 0; w * BITS < count; w++)
    active[w] = count - w * BITS < BITS ? ((uint64_t)1 << (count - w * BITS)) - 1 : ~(uint64_t)0;
}

/* Of `count` inputs, padded with anything. */
static void find_active(const float *in, int count, active_inputs active) {
  all_active(count, active);
  for (int w = 0; w * BITS < count; w++) {
    uint64_t word = 0;
    for (int n = w * BITS; n < count && n < (w + 1) * BITS; n += GROUSER_FLOATS)
      word |= (uint64_t)lanes_not_zero(lanes_load(in + n)) << n % BITS;
    active[w] &= word;
  }
}

GROUSER_INLINE void add_row(const float *weights, size_t stride, const float *in, int i, grouser_lanes *sum,
                            const int vectors) {
  const float *row = weights + (size_t)i * stride;
  const grouser_lanes value = lanes_of(in[i]);
  GROUSER_UNROLL
  for (int v = 0; v < vectors; v++) sum[v] = lanes_fma(value, lanes_load(row + v * GROUSER_FLOATS), sum[v]);
}

/* affine_vectors of one row without the inputs that are zero: the same sums to the bit, for half of the weights where
 * half of the units are silent. */
GROUSER_INLINE void active_vectors(const float *weights, size_t stride, const float *bias, const float *in, int inputs,
                                   const active_inputs active, float *out, const int vectors) {
  grouser_lanes even[SUMS], odd[SUMS];
  GROUSER_UNROLL
  for (int v = 0; v < vectors; v++) {
    even[v] = lanes_load(bias + v * GROUSER_FLOATS);
    odd[v] = lanes_of(0.0f);
  }
  for (int w = 0; w * BITS < inputs; w++) {
    uint64_t evens = active[w] & EVEN, odds = active[w] & ~EVEN;
    while (evens && odds) {
      add_row(weights, stride, in, w * BITS + take_bit(&evens), even, vectors);
      add_row(weights, stride, in, w * BITS + take_bit(&odds), odd, vectors);
    }
    while (evens) add_row(weights, stride, in, w * BITS + take_bit(&evens), even, vectors);
    while (odds) add_row(weights, stride, in, w * BITS + take_bit(&odds), odd, vectors);
  }
  GROUSER_UNROLL
  for (int v = 0; v < vectors; v++) lanes_store(out + v * GROUSER_FLOATS, even[v] + odd[v]);
}

GROUSER_INLINE void affine_active(const float *weights, const float *bias, const float *in, int inputs,
                                  const active_inputs active, float *out, int outputs) {
  const int stride = grouser_padded(outputs);
  int done = 0;
  for (; done + 8 * GROUSER_FLOATS <= stride; done += 8 * GROUSER_FLOATS)
    active_vectors(weights + done, (size_t)stride, bias + done, in, inputs, active, out + done, 8);
  for (; done + 4 * GROUSER_FLOATS <= stride; done += 4 * GROUSER_FLOATS)
    active_vectors(weights + done, (size_t)stride, bias + done, in, inputs, active, out + done, 4);
  for (; done < stride; done += GROUSER_FLOATS)
    active_vectors(weights + done, (size_t)stride, bias + done, in, inputs, active, out + done, 1);
}

/* As many outputs at most are sums along the inputs, in vectors of inputs. */
enum { FEW = 4, RUNNING = 16 / GROUSER_FLOATS };

/* Outputs of `rows` rows, GROUSER_MAX_WIDTH apart, each from sixteen running sums. The inputs are padded with zeros. */
GROUSER_INLINE void affine_few(const float *transposed, const float *bias, const float *in, int inputs, float *out,
                               int outputs, const int rows, const int group) {
  const int padded = grouser_padded(inputs);
  for (int r = 0; r < rows; r++) {
    const float *value = in + r * GROUSER_MAX_WIDTH;
    for (int o = 0; o < outputs; o++) {
      const float *weight = transposed + (size_t)o * (size_t)padded;
      grouser_lanes sum[RUNNING];
      GROUSER_UNROLL
      for (int s = 0; s < RUNNING; s++) sum[s] = lanes_of(0.0f);
      for (int i = 0; i < padded; i += 16)
        GROUSER_UNROLL
        for (int s = 0; s < RUNNING; s++)
          sum[s] = lanes_fma(lanes_load(value + i + s * GROUSER_FLOATS), lanes_load(weight + i + s * GROUSER_FLOATS),
                             sum[s]);
      out[r * GROUSER_MAX_WIDTH + o] = lanes_sum(sum) + (r % group == 0 ? bias[o] : 0.0f);
    }
  }
}

/* Whether a layer's outputs are sums along the inputs. Those of the first layer are not padded. */
static int sums_along(const grouser_dense *net, int layer) { return layer > 0 && net->widths[layer + 1] <= FEW; }

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

/* One layer of `rows` rows; of every `group`, the first has the bias. */
GROUSER_INLINE void affine_layer(const grouser_dense *net, int layer, const float *in, float *out, const int rows,
                                 const int group) {
  const int inputs = net->widths[layer], outputs = net->widths[layer + 1];
  if (sums_along(net, layer))
    affine_few(net->transposed[layer], net->biases[layer], in, inputs, out, outputs, rows, group);
  else
    affine_rows(net->weights[layer], net->biases[layer], in, inputs, out, outputs, rows, group);
}

GROUSER_INLINE void forward_rows(const grouser_dense *net, const float *inputs, float *outputs,
                                 grouser_slopes *const slopes, const int rows) {
  float buffer[2][2 * GROUSER_MAX_WIDTH];
  const float *value = inputs;
  const int last = net->layers - 1;
  for (int layer = 0; layer < last; layer++) {
    float *next = buffer[layer % 2];
    affine_layer(net, layer, value, next, rows, 1);
    activate_rows(net->activation, next, slopes ? slopes[0][layer] : NULL, slopes && rows > 1 ? slopes[1][layer] : NULL,
                  grouser_padded(net->widths[layer + 1]), rows);
    value = next;
  }
  affine_layer(net, last, value, outputs, rows, 1);
}

/* Overwrites z by its positive part, notes what is active, and writes the slopes unless NULL. */
GROUSER_INLINE void rectify(float *value, float *slope, int padded, active_inputs active) {
  for (int w = 0; w * BITS < padded; w++) {
    uint64_t word = 0;
    for (int n = w * BITS; n < padded && n < (w + 1) * BITS; n += GROUSER_FLOATS) {
      grouser_lanes by;
      const grouser_lanes positive = activated(GROUSER_RELU, lanes_load(value + n), &by);
      lanes_store(value + n, positive);
      if (slope) lanes_store(slope + n, by);
      word |= (uint64_t)lanes_not_zero(positive) << n % BITS;
    }
    active[w] = word;
  }
}

/* A row of a network whose units are silent below zero. */
GROUSER_INLINE void forward_active(const grouser_dense *net, const float *inputs, float *outputs,
                                   grouser_slopes *slopes) {
  float buffer[2][GROUSER_MAX_WIDTH];
  active_inputs active;
  const float *value = inputs;
  const int last = net->layers - 1;
  for (int layer = 0; layer <= last; layer++) {
    const int width = net->widths[layer + 1];
    float *next = layer == last ? outputs : buffer[layer % 2];
    if (layer == 0 || sums_along(net, layer))
      affine_layer(net, layer, value, next, 1, 1);
    else
      affine_active(net->weights[layer], net->biases[layer], value, net->widths[layer], active, next, width);
    if (layer < last) rectify(next, slopes ? (*slopes)[layer] : NULL, grouser_padded(width), active);
    value = next;
  }
}

void grouser_dense_forward(const grouser_dense *net, const float *inputs, float *outputs, grouser_slopes *slopes) {
  if (net->activation == GROUSER_RELU)
    forward_active(net, inputs, outputs, slopes);
  else
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
    affine_layer(net, layer, value, next, DUAL_ROWS, DUAL_ROWS);
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
