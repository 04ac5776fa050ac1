#include "grouser/mlp.h"

void grouser_mlp_forces(const grouser_mlp *net, const double *x, double force[GROUSER_OUTPUTS], double *jacobian) {
  float value[GROUSER_MAX_COLUMNS], result[GROUSER_MAX_WIDTH];
  grouser_slopes slopes;
  const int inputs = net->dense.widths[0];
  for (int i = 0; i < inputs; i++) value[i] = (float)((x[i] - net->input_mean[i]) / net->input_scale[i]);
  grouser_dense_forward(&net->dense, value, result, slopes);
  for (int n = 0; n < GROUSER_OUTPUTS; n++) force[n] = net->output_mean[n] + net->output_scale[n] * (double)result[n];
  if (!jacobian) return;

  /* Backwards from the outputs: three rows cost less than one column an input. */
  float rows[GROUSER_SEEDS * GROUSER_MAX_WIDTH] = {0};
  for (int n = 0; n < GROUSER_OUTPUTS; n++) rows[n * GROUSER_MAX_WIDTH + n] = 1.0f;
  grouser_dense_backward(&net->dense, slopes, rows);
  for (int n = 0; n < GROUSER_OUTPUTS; n++)
    for (int i = 0; i < inputs; i++)
      jacobian[n * inputs + i] = net->output_scale[n] * (double)rows[n * GROUSER_MAX_WIDTH + i] / net->input_scale[i];
}
