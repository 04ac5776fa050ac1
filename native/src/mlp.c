#include "grouser/mlp.h"

#include <string.h>

void grouser_mlp_prepare(grouser_mlp *net) {
  for (int i = 0; i < net->dense.widths[0]; i++) net->input_gain[i] = 1.0 / net->input_scale[i];
}

void grouser_mlp_forces(const grouser_mlp *net, const double *x, double force[GROUSER_OUTPUTS], double *jacobian) {
  float value[GROUSER_MAX_COLUMNS], result[GROUSER_MAX_WIDTH];
  grouser_slopes slopes;
  const int inputs = net->dense.widths[0];
  for (int i = 0; i < inputs; i++) value[i] = (float)((x[i] - net->input_mean[i]) * net->input_gain[i]);
  grouser_dense_forward(&net->dense, value, result, jacobian ? &slopes : NULL);
  for (int n = 0; n < GROUSER_OUTPUTS; n++) force[n] = net->output_mean[n] + net->output_scale[n] * (double)result[n];
  if (!jacobian) return;

  /* Backwards from the outputs: three rows cost less than one column an input. */
  float rows[GROUSER_SEEDS * GROUSER_MAX_WIDTH];
  for (int n = 0; n < GROUSER_OUTPUTS; n++)
    for (int m = 0; m < GROUSER_OUTPUTS; m++) rows[n * GROUSER_MAX_WIDTH + m] = n == m ? 1.0f : 0.0f;
  grouser_dense_backward(&net->dense, slopes, rows);
  for (int n = 0; n < GROUSER_OUTPUTS; n++)
    for (int i = 0; i < inputs; i++)
      jacobian[n * inputs + i] = net->output_scale[n] * (double)rows[n * GROUSER_MAX_WIDTH + i] * net->input_gain[i];
}

void grouser_mlp_body(const grouser_mlp *net, const double *x, double force[GROUSER_OUTPUTS],
                      double slope[GROUSER_OUTPUTS][3]) {
  float in[(1 + GROUSER_SEEDS) * GROUSER_MAX_WIDTH], out[(1 + GROUSER_SEEDS) * GROUSER_MAX_WIDTH];
  const int inputs = net->dense.widths[0];
  if (!slope) {
    grouser_mlp_forces(net, x, force, NULL);
    return;
  }
  for (int i = 0; i < inputs; i++) {
    in[i] = (float)((x[i] - net->input_mean[i]) * net->input_gain[i]);
    for (int d = 0; d < GROUSER_SEEDS; d++)
      in[(1 + d) * GROUSER_MAX_WIDTH + i] = d == i ? (float)net->input_gain[i] : 0.0f;
  }
  grouser_dense_dual(&net->dense, in, out);
  for (int n = 0; n < GROUSER_OUTPUTS; n++) {
    force[n] = net->output_mean[n] + net->output_scale[n] * (double)out[n];
    for (int d = 0; d < GROUSER_SEEDS; d++)
      slope[n][d] = net->output_scale[n] * (double)out[(1 + d) * GROUSER_MAX_WIDTH + n];
  }
}

void grouser_mlp_block(const grouser_mlp *net, const grouser_block_rows *rows, int want_slopes,
                       grouser_block_forces *out) {
  float in[GROUSER_MAX_COLUMNS * GROUSER_DUAL], result[GROUSER_PANEL * GROUSER_DUAL];
  float scratch[2 * GROUSER_MAX_WIDTH * GROUSER_DUAL];
  const int inputs = net->dense.widths[0];
  const size_t stride = want_slopes ? (size_t)GROUSER_DUAL : (size_t)GROUSER_BLOCK;
  for (int i = 0; i < inputs; i++) {
    const double mean = net->input_mean[i], gain = net->input_gain[i];
    float *row = in + (size_t)i * stride;
    for (int l = 0; l < GROUSER_BLOCK; l++) row[l] = (float)((rows->column[i][l] - mean) * gain);
    if (!want_slopes) continue;
    for (int d = 0; d < GROUSER_SEEDS; d++)
      for (int l = 0; l < GROUSER_BLOCK; l++) row[(1 + d) * GROUSER_BLOCK + l] = d == i ? (float)gain : 0.0f;
  }
  if (want_slopes)
    grouser_dense_block(&net->dense, in, result, scratch);
  else
    grouser_dense_batch(&net->dense, in, GROUSER_BLOCK, result, scratch);
  for (int n = 0; n < GROUSER_OUTPUTS; n++) {
    const float *row = result + (size_t)n * stride;
    const double mean = net->output_mean[n], scale = net->output_scale[n];
    for (int l = 0; l < GROUSER_BLOCK; l++) out->force[n][l] = mean + scale * (double)row[l];
    if (!want_slopes) continue;
    for (int d = 0; d < GROUSER_SEEDS; d++)
      for (int l = 0; l < GROUSER_BLOCK; l++) out->slope[n][d][l] = scale * (double)row[(1 + d) * GROUSER_BLOCK + l];
  }
}

enum { BATCH = 2 * GROUSER_BLOCK };

void grouser_mlp_rows(const grouser_mlp *net, const double *x, ptrdiff_t rows, double *forces) {
  float in[GROUSER_MAX_COLUMNS * BATCH], result[GROUSER_PANEL * BATCH], scratch[2 * GROUSER_MAX_WIDTH * BATCH];
  const int inputs = net->dense.widths[0];
  for (ptrdiff_t first = 0; first < rows; first += BATCH) {
    const int count = rows - first < BATCH ? (int)(rows - first) : BATCH;
    for (int l = 0; l < BATCH; l++) {
      const double *row = x + (first + (l < count ? l : 0)) * inputs;
      for (int i = 0; i < inputs; i++) in[i * BATCH + l] = (float)((row[i] - net->input_mean[i]) * net->input_gain[i]);
    }
    grouser_dense_batch(&net->dense, in, BATCH, result, scratch);
    for (int l = 0; l < count; l++)
      for (int n = 0; n < GROUSER_OUTPUTS; n++)
        forces[(first + l) * GROUSER_OUTPUTS + n] =
            net->output_mean[n] + net->output_scale[n] * (double)result[n * BATCH + l];
  }
}
