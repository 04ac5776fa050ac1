/* Dense layers in float32 with one activation between them. */
#ifndef GROUSER_DENSE_H
#define GROUSER_DENSE_H

enum grouser_activation { GROUSER_RELU = 0, GROUSER_SILU = 1, GROUSER_TANH = 2 };

enum { GROUSER_MAX_LAYERS = 8, GROUSER_MAX_WIDTH = 512, GROUSER_SEEDS = 3 };

typedef struct {
  enum grouser_activation activation;
  int layers;                               /* weight matrices, 1..GROUSER_MAX_LAYERS */
  int widths[GROUSER_MAX_LAYERS + 1];       /* inputs, hidden ..., outputs; each 1..GROUSER_MAX_WIDTH */
  const float *weights[GROUSER_MAX_LAYERS]; /* inputs x outputs, row-major */
  const float *biases[GROUSER_MAX_LAYERS];
} grouser_dense;

/* Derivatives of the activations of one forward pass. */
typedef float grouser_slopes[GROUSER_MAX_LAYERS][GROUSER_MAX_WIDTH];

/* Writes the outputs (widths[layers]) for the inputs (widths[0]), and the slopes that the backward pass takes. */
void grouser_dense_forward(const grouser_dense *net, const float *inputs, float *outputs, grouser_slopes slopes);

/* For three rows of seeds over the outputs, writes three rows of seeds' derivatives by the inputs; rows are
 * GROUSER_MAX_WIDTH apart, and `rows` is overwritten on the way. */
void grouser_dense_backward(const grouser_dense *net, grouser_slopes slopes, float rows[GROUSER_SEEDS * GROUSER_MAX_WIDTH]);

#endif
