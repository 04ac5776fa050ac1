/* A dense network in float32 between float64 interface columns and forces. */
#ifndef GROUSER_MLP_H
#define GROUSER_MLP_H

#include "dense.h"
#include "interface.h"

typedef struct {
  grouser_dense dense;
  double input_mean[GROUSER_MAX_COLUMNS], input_scale[GROUSER_MAX_COLUMNS];
  double output_mean[GROUSER_OUTPUTS], output_scale[GROUSER_OUTPUTS];
} grouser_mlp;

/* y = output_mean + output_scale * net((x - input_mean) / input_scale).
 *
 * x: widths[0] columns. force: 3 outputs. jacobian: NULL, or 3 x widths[0], row-major.
 */
void grouser_mlp_forces(const grouser_mlp *net, const double *x, double force[GROUSER_OUTPUTS], double *jacobian);

#endif
