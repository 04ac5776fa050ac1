/* A dense network in float32 between float64 interface columns and forces. */
#ifndef GROUSER_MLP_H
#define GROUSER_MLP_H

#include "interface.h"

enum grouser_activation { GROUSER_RELU = 0, GROUSER_SILU = 1, GROUSER_TANH = 2 };

enum { GROUSER_MAX_LAYERS = 8, GROUSER_MAX_WIDTH = 512 };

typedef struct {
  enum grouser_activation activation;
  int layers;                               /* weight matrices, 1..GROUSER_MAX_LAYERS */
  int widths[GROUSER_MAX_LAYERS + 1];       /* inputs, hidden ..., outputs */
  const float *weights[GROUSER_MAX_LAYERS]; /* inputs x outputs, row-major */
  const float *biases[GROUSER_MAX_LAYERS];
  double input_mean[GROUSER_MAX_COLUMNS], input_scale[GROUSER_MAX_COLUMNS];
  double output_mean[GROUSER_OUTPUTS], output_scale[GROUSER_OUTPUTS];
} grouser_mlp;

/* y = output_mean + output_scale * net((x - input_mean) / input_scale).
 *
 * x: widths[0] columns. force: 3 outputs. jacobian: NULL, or 3 x widths[0], row-major.
 */
void grouser_mlp_forces(const grouser_mlp *net, const double *x, double force[GROUSER_OUTPUTS], double *jacobian);

#endif
