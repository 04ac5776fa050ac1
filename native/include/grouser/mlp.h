/* A dense network in float32 between float64 interface columns and forces. */
#ifndef GROUSER_MLP_H
#define GROUSER_MLP_H

#include <stddef.h>

#include "dense.h"
#include "interface.h"

typedef struct {
  grouser_dense dense;
  double input_mean[GROUSER_MAX_COLUMNS], input_scale[GROUSER_MAX_COLUMNS];
  double output_mean[GROUSER_OUTPUTS], output_scale[GROUSER_OUTPUTS];
  double input_gain[GROUSER_MAX_COLUMNS]; /* 1/input_scale, filled in by grouser_mlp_prepare */
} grouser_mlp;

GROUSER_CORE void grouser_mlp_prepare(grouser_mlp *net);

/* y = output_mean + output_scale * net((x - input_mean) / input_scale).
 *
 * x: widths[0] columns. force: 3 outputs. jacobian: NULL, or 3 x widths[0], row-major.
 */
GROUSER_CORE void grouser_mlp_forces(const grouser_mlp *net, const double *x, double force[GROUSER_OUTPUTS],
                                     double *jacobian);
/* As evaluate_body of a grouser_kernel, the same to the bit as the block. */
GROUSER_CORE void grouser_mlp_body(const grouser_mlp *net, const double *x, double force[GROUSER_OUTPUTS],
                                   double slope[GROUSER_OUTPUTS][3]);
/* As evaluate_block of a grouser_kernel; a plain network has one row for both tracks, the left one. */
GROUSER_CORE void grouser_mlp_block(const grouser_mlp *net, const grouser_block_rows *rows, int want_slopes,
                                    grouser_block_forces *out);
/* Writes the forces (rows x 3) of any number of rows. */
GROUSER_CORE void grouser_mlp_rows(const grouser_mlp *net, const double *x, ptrdiff_t rows, double *forces);

#endif
