#include <stddef.h>
#include <string.h>

#include "grouser/dense.h"
#include "lanes.h"

/* From seeds over the outputs to their derivatives by the inputs. It goes on from the parts of dense.c. */

/* Three seeds share every load of a weight. */
GROUSER_INLINE void add_seeds(const float *weights, size_t stride, const float *from, int i,
                              grouser_lanes sum[GROUSER_SEEDS][2], const int vectors) {
  const float *row = weights + (size_t)i * stride;
  GROUSER_UNROLL
  for (int v = 0; v < vectors; v++) {
    const grouser_lanes weight = lanes_load(row + v * GROUSER_FLOATS);
    GROUSER_UNROLL
    for (int n = 0; n < GROUSER_SEEDS; n++)
      sum[n][v] = lanes_fma(lanes_of(from[n * GROUSER_MAX_WIDTH + i]), weight, sum[n][v]);
  }
}

/* Of the active rows of weights. */
GROUSER_INLINE void backward_vectors(const float *weights, size_t stride, const float *from, int inputs,
                                     const active_inputs active, float *to, const int vectors) {
  grouser_lanes even[GROUSER_SEEDS][2], odd[GROUSER_SEEDS][2];
  GROUSER_UNROLL
  for (int n = 0; n < GROUSER_SEEDS; n++)
    GROUSER_UNROLL
    for (int v = 0; v < vectors; v++) even[n][v] = odd[n][v] = lanes_of(0.0f);
  for (int w = 0; w * BITS < inputs; w++) {
    uint64_t evens = active[w] & EVEN, odds = active[w] & ~EVEN;
    while (evens && odds) {
      add_seeds(weights, stride, from, w * BITS + take_bit(&evens), even, vectors);
      add_seeds(weights, stride, from, w * BITS + take_bit(&odds), odd, vectors);
    }
    while (evens) add_seeds(weights, stride, from, w * BITS + take_bit(&evens), even, vectors);
    while (odds) add_seeds(weights, stride, from, w * BITS + take_bit(&odds), odd, vectors);
  }
  GROUSER_UNROLL
  for (int n = 0; n < GROUSER_SEEDS; n++)
    GROUSER_UNROLL
    for (int v = 0; v < vectors; v++)
      lanes_store(to + n * GROUSER_MAX_WIDTH + v * GROUSER_FLOATS, even[n][v] + odd[n][v]);
}

GROUSER_INLINE void backward_layer(const float *transposed, int padded, const float *from, int inputs,
                                   const active_inputs active, float *to) {
  int done = 0;
  for (; done + 2 * GROUSER_FLOATS <= padded; done += 2 * GROUSER_FLOATS)
    backward_vectors(transposed + done, (size_t)padded, from, inputs, active, to + done, 2);
  for (; done < padded; done += GROUSER_FLOATS)
    backward_vectors(transposed + done, (size_t)padded, from, inputs, active, to + done, 1);
}

void grouser_dense_backward(const grouser_dense *net, grouser_slopes slopes,
                            float rows[GROUSER_SEEDS * GROUSER_MAX_WIDTH]) {
  float back[GROUSER_SEEDS * GROUSER_MAX_WIDTH];
  float *from = rows, *to = back;
  const int last = net->layers - 1;
  for (int layer = last; layer >= 0; layer--) {
    const int inputs = net->widths[layer + 1], padded = grouser_padded(net->widths[layer]);
    active_inputs active;
    if (layer == last) {
      all_active(inputs, active);
    } else {
      /* What is behind a slope of zero is not looked at. */
      find_active(slopes[layer], inputs, active);
      for (int n = 0; net->activation != GROUSER_RELU && n < GROUSER_SEEDS; n++)
        for (int i = 0; i < inputs; i++) from[n * GROUSER_MAX_WIDTH + i] *= slopes[layer][i];
    }
    backward_layer(net->transposed[layer], padded, from, inputs, active, to);
    float *const swap = from;
    from = to;
    to = swap;
  }
  for (int n = 0; from != rows && n < GROUSER_SEEDS; n++)
    memcpy(rows + n * GROUSER_MAX_WIDTH, back + n * GROUSER_MAX_WIDTH, sizeof(float) * (size_t)net->widths[0]);
}
