/* Dense layers in float32 with one activation between them. */
#ifndef GROUSER_DENSE_H
#define GROUSER_DENSE_H

#include "kernel.h"

enum grouser_activation { GROUSER_RELU = 0, GROUSER_SILU = 1, GROUSER_TANH = 2 };

enum {
  GROUSER_MAX_LAYERS = 8,
  GROUSER_MAX_WIDTH = 512,
  GROUSER_SEEDS = 3,
  GROUSER_PANEL = 16, /* rows of weights are padded to whole panels */
  GROUSER_ALIGNMENT = 64
};

typedef struct {
  enum grouser_activation activation;
  int layers;                               /* weight matrices, 1..GROUSER_MAX_LAYERS */
  int widths[GROUSER_MAX_LAYERS + 1];       /* inputs, hidden ..., outputs; each 1..GROUSER_MAX_WIDTH */
  const float *weights[GROUSER_MAX_LAYERS]; /* inputs x grouser_padded(outputs), row-major, zeros past the outputs */
  const float *biases[GROUSER_MAX_LAYERS];  /* grouser_padded(outputs) */
  const float *transposed[GROUSER_MAX_LAYERS]; /* outputs x grouser_padded(inputs), as the weights */
  int widest;                                  /* of the padded layers behind the inputs */
} grouser_dense;

static inline int grouser_padded(int width) { return (width + GROUSER_PANEL - 1) / GROUSER_PANEL * GROUSER_PANEL; }

/* Derivatives of the activations of one forward pass. */
typedef float grouser_slopes[GROUSER_MAX_LAYERS][GROUSER_MAX_WIDTH];

/* Writes the outputs (padded widths[layers]) for the inputs (widths[0]) and, unless NULL, the slopes that the backward
 * pass takes. The pair takes two rows of inputs, writes two of outputs, each GROUSER_MAX_WIDTH apart, and two slopes. */
GROUSER_CORE void grouser_dense_forward(const grouser_dense *net, const float *inputs, float *outputs,
                                        grouser_slopes *slopes);
GROUSER_CORE void grouser_dense_forward_pair(const grouser_dense *net, const float *inputs, float *outputs,
                                             grouser_slopes *slopes);

/* A value and its derivatives in three directions: four rows, GROUSER_MAX_WIDTH apart. The same to the bit as a lane of
 * grouser_dense_block. */
GROUSER_CORE void grouser_dense_dual(const grouser_dense *net, const float *in, float *out);

/* For three rows of seeds over the outputs, writes three rows of seeds' derivatives by the inputs; rows are
 * GROUSER_MAX_WIDTH apart, and `rows` is overwritten on the way. */
GROUSER_CORE void grouser_dense_backward(const grouser_dense *net, grouser_slopes slopes,
                                         float rows[GROUSER_SEEDS * GROUSER_MAX_WIDTH]);

/* `count` samples side by side, a multiple of GROUSER_BLOCK: in[inputs][count] to out[padded outputs][count]. `scratch`
 * holds 2 * widest * count. */
GROUSER_CORE void grouser_dense_batch(const grouser_dense *net, const float *in, int count, float *out, float *scratch);

/* Values of a block and their derivatives in three directions: rows of [value, d1, d2, d3][GROUSER_BLOCK], padded as
 * above. */
enum { GROUSER_DUAL = (1 + GROUSER_SEEDS) * GROUSER_BLOCK };
GROUSER_CORE void grouser_dense_block(const grouser_dense *net, const float *in, float *out, float *scratch);

#endif
