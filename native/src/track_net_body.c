#include <stddef.h>
#include <string.h>

#include "grouser/track_net.h"
#include "load.h"
#include "shear_point.h"

/* The structured surrogate for one vehicle with the slopes that Newton asks for: forwards, as a block has them, so that
 * both have the same bits. It goes on from the parts of track_net.c. */

/* Adds one track with its slopes by the body's motion, operation by operation as a lane of the block. */
GROUSER_INLINE void add_side(const grouser_track_net *net, const double *x, enum grouser_side side, const int exact,
                     double force[GROUSER_OUTPUTS], double slope[GROUSER_OUTPUTS][3]) {
  enum { PARTS = 1 + GROUSER_SEEDS };
  const grouser_physics *block = &net->block;
  const int wheels = block->wheels;
  const enum grouser_side sides[SIDES] = {side, side};
  const double sign = side == GROUSER_LEFT ? 1.0 : -1.0, half_tread = block->tread / 2, half = block->element_length / 2;
  double share[GROUSER_MAX_WHEELS], share_by_ax[GROUSER_MAX_WHEELS];
  double sum[GROUSER_OUTPUTS][PARTS], own[GROUSER_OUTPUTS][PARTS];
  float input[PARTS * GROUSER_MAX_WIDTH], output[PARTS * GROUSER_MAX_WIDTH];
  track_shear shear;
  track_load load;
  shear_tracks(net, x, sides, 1, 1, &shear);
  grouser_element_shares(block, x[GROUSER_AX], share, share_by_ax);
  load.share = share;
  load.share_by_ax = share_by_ax;
  load_track(net, x, side, grouser_friction_tangent(block, x + GROUSER_TERRAIN), 0, &load);

  const grouser_gate *gate = &shear.gate[0];
  const double z_by[3] = {gate->z_by_vx, gate->z_by_vy, gate->z_by_yaw};
  const double size_by_z = 4 / ((gate->z + 4) * (gate->z + 4));
  read_features(net, &shear, 0, input);
  for (int d = 0; exact && d < GROUSER_SEEDS; d++) {
    float *row = input + (1 + d) * GROUSER_MAX_WIDTH;
    for (int j = 0; j < GROUSER_POINTS; j++) {
      row[j] = (float)(shear.x_by[d][j] * net->input_gain[j]);
      row[GROUSER_POINTS + j] = (float)(shear.y_by[d][j] * net->input_gain[GROUSER_POINTS + j]);
    }
    row[GROUSER_SHEAR] = (float)(size_by_z * z_by[d] * net->input_gain[GROUSER_SHEAR]);
    row[GROUSER_SHEAR + 1] = 0;
  }
  if (exact)
    grouser_dense_dual(&net->dense, input, output);
  else
    grouser_dense_forward(&net->dense, input, output, NULL);

  memset(sum, 0, sizeof sum);
  for (int i = 0; i < wheels; i++)
    for (int p = 0; p < (exact ? PARTS : 1); p++) {
      const float *y = output + p * GROUSER_MAX_WIDTH;
      const double mean[3] = {p ? 0.0 : net->output_mean[i], p ? 0.0 : net->output_mean[wheels + i],
                              p ? 0.0 : net->output_mean[2 * wheels + i]};
      const double aside = mean[1] + net->output_scale[wheels + i] * (double)y[wheels + i];
      const double turn = mean[2] + net->output_scale[2 * wheels + i] * (double)y[2 * wheels + i];
      sum[0][p] += load.stress[i] * (mean[0] + net->output_scale[i] * (double)y[i]);
      sum[1][p] += load.stress[i] * aside;
      sum[2][p] += load.stress[i] * (net->arm[i] * aside + half * turn);
    }
  for (int n = 0; n < GROUSER_OUTPUTS; n++)
    for (int p = 0; p < PARTS; p++) {
      const double *points = p == 0 ? (n == 0 ? shear.x : shear.y) : (n == 0 ? shear.x_by[p - 1] : shear.y_by[p - 1]);
      const double *by = n == 2 ? load.moment : load.force;
      double value = exact || p == 0 ? gate->gate * sum[n][p] : 0.0;
      if (exact && p > 0) value += gate->gate_by_z * z_by[p - 1] * sum[n][0];
      for (int j = 0; j < GROUSER_POINTS; j++) value += by[j] * points[j];
      own[n][p] = value;
    }
  own[0][0] -= load.rolling * load.load * shear.slip[0].direction;
  for (int p = 0; p < PARTS; p++) {
    const double column_sign = p > 1 ? sign : 1.0;
    for (int n = 0; n < GROUSER_OUTPUTS; n++) {
      const double row_sign = n == 0 ? column_sign : sign * column_sign;
      const double value = row_sign * (n == 2 ? own[2][p] - half_tread * own[0][p] : own[n][p]);
      if (p == 0)
        force[n] += value;
      else
        slope[n][p - 1] += value;
    }
  }
}

GROUSER_INLINE void add_sides(const grouser_track_net *net, const double *left, const double *right, const int exact,
                              double force[GROUSER_OUTPUTS], double slope[GROUSER_OUTPUTS][3]) {
  add_side(net, left, GROUSER_LEFT, exact, force, slope);
  add_side(net, right, GROUSER_RIGHT, exact, force, slope);
}

void grouser_track_net_body(const grouser_track_net *net, const double *left, const double *right,
                            enum grouser_slopes_wanted wanted, double force[GROUSER_OUTPUTS],
                            double slope[GROUSER_OUTPUTS][3]) {
  if (wanted != GROUSER_NO_SLOPES) {
    for (int n = 0; n < GROUSER_OUTPUTS; n++) force[n] = 0;
    memset(slope, 0, sizeof(double) * GROUSER_OUTPUTS * 3);
    if (wanted == GROUSER_EXACT_SLOPES)
      add_sides(net, left, right ? right : left, 1, force, slope);
    else
      add_sides(net, left, right ? right : left, 0, force, slope);
  } else if (right) {
    double other[GROUSER_OUTPUTS];
    grouser_track_net_track(net, left, GROUSER_LEFT, force, NULL);
    grouser_track_net_track(net, right, GROUSER_RIGHT, other, NULL);
    for (int n = 0; n < GROUSER_OUTPUTS; n++) force[n] += other[n];
  } else {
    grouser_track_net_forces(net, left, force, NULL);
  }
}
