#include <math.h>
#include <string.h>

#include "grouser/track_net.h"
#include "lane_loop.h"
#include "load_block.h"
#include "shear_point.h"

/* The structured surrogate for a block of vehicles, lane by lane: the same equations as for one, the same loops over
 * points and wheels, each around a loop over lanes. */

enum { LANES = GROUSER_BLOCK, BLOCK_SIDES = 2 };

typedef double lane_row[LANES];

/* What is prepared of a track: rolling direction and 1/(K sqrt(Vt^2 + V_eps^2)), rolling resistance in N, what the
 * points' shear counts in force and moment, and the elements' strengths in N. */
enum { DIRECTION, PER_METER, RESISTANCE, WEIGHT, MOMENT = WEIGHT + GROUSER_POINTS, STRESS = MOMENT + GROUSER_POINTS };
enum { PREPARED_FITS = 1 / (BLOCK_SIDES * (STRESS + GROUSER_MAX_WHEELS) <= GROUSER_MAX_PREPARED) };

static int side_rows(const grouser_track_net *net) { return STRESS + net->block.wheels; }

int grouser_track_net_prepared_rows(const grouser_track_net *net) { return BLOCK_SIDES * side_rows(net); }

/* Slip velocity, shear, gate, and their derivatives by the mirrored vx, vy and yaw rate. */
typedef struct {
  lane_row along, across, yaw_rate;
  lane_row x[GROUSER_POINTS], y[GROUSER_POINTS];
  lane_row x_by[GROUSER_SEEDS][GROUSER_POINTS], y_by[GROUSER_SEEDS][GROUSER_POINTS];
  lane_row gate, gate_by[GROUSER_SEEDS], size, size_by[GROUSER_SEEDS];
} block_shear;

static void slip_of_block(const grouser_track_net *net, const grouser_block_rows *rows, enum grouser_side side,
                          block_shear *shear) {
  const grouser_physics *block = &net->block;
  const double sign = grouser_sign(side), half_tread = block->tread / 2, center = block->contact_center;
  const double *belt = grouser_belt_in(rows, side);
  GROUSER_LANE_LOOP
  for (int l = 0; l < LANES; l++) {
    grouser_slip s;
    grouser_move_slip(&s, rows->column[GROUSER_VX][l], sign * rows->column[GROUSER_VY][l],
                      sign * rows->column[GROUSER_YAW_RATE][l], belt[l], half_tread, center);
    shear->along[l] = s.along;
    shear->across[l] = s.across;
    shear->yaw_rate[l] = s.yaw_rate;
  }
}

/* Without what the slopes by belt and modulus take. */
GROUSER_INLINE grouser_slip lane_slip(const block_shear *shear, const lane_row *prepared, int l) {
  const grouser_slip s = {shear->along[l],        shear->across[l], shear->yaw_rate[l],     1.0,
                          prepared[DIRECTION][l], 0.0,              prepared[PER_METER][l], 1.0};
  return s;
}

/* Sizes of the slip at the ends of the parts; where one part begins, the one before it ends. */
GROUSER_INLINE void sizes_of_block(const grouser_track_net *net, const lane_row *prepared, const block_shear *shear,
                                   double end, lane_row size) {
  const double width_square = part_of(net, 0).width_square;
  GROUSER_LANE_LOOP
  for (int l = 0; l < LANES; l++) size[l] = grouser_slip_size(lane_slip(shear, prepared, l), end, width_square);
}

GROUSER_INLINE void shear_of_block(const grouser_track_net *net, const lane_row *prepared,
                                   const enum grouser_slopes_wanted wanted, block_shear *shear) {
  const grouser_physics *block = &net->block;
  lane_row sizes[2];
  for (int j = 0; j < GROUSER_POINTS; j++) {
    const grouser_part part = part_of(net, j);
    const double *rear = sizes[j % 2], *front = sizes[(j + 1) % 2];
    if (j == 0 || part.rear != part_of(net, j - 1).front) sizes_of_block(net, prepared, shear, part.rear, sizes[j % 2]);
    sizes_of_block(net, prepared, shear, part.front, sizes[(j + 1) % 2]);
    GROUSER_LANE_LOOP
    for (int l = 0; l < LANES; l++) {
      const grouser_shear_point p = grouser_shear_between(lane_slip(shear, prepared, l), part, rear[l], front[l]);
      shear->x[j][l] = p.x;
      shear->y[j][l] = p.y;
      if (wanted == GROUSER_NO_SLOPES) continue;
      shear->x_by[0][j][l] = p.x_by_vx;
      shear->x_by[1][j][l] = p.x_by_vy;
      shear->x_by[2][j][l] = p.x_by_yaw;
      shear->y_by[0][j][l] = p.y_by_vx;
      shear->y_by[1][j][l] = p.y_by_vy;
      shear->y_by[2][j][l] = p.y_by_yaw;
    }
  }
  GROUSER_LANE_LOOP
  for (int l = 0; l < LANES; l++) {
    const grouser_gate g = grouser_gate_of(lane_slip(shear, prepared, l), block->tread / 2, block->contact_center,
                                           block->contact_length / 2, net->half_travel);
    const double by_z = 4 / ((g.z + 4) * (g.z + 4));
    shear->gate[l] = g.gate;
    shear->size[l] = g.z / (g.z + 4);
    if (wanted != GROUSER_EXACT_SLOPES) continue;
    shear->gate_by[0][l] = g.gate_by_z * g.z_by_vx;
    shear->gate_by[1][l] = g.gate_by_z * g.z_by_vy;
    shear->gate_by[2][l] = g.gate_by_z * g.z_by_yaw;
    shear->size_by[0][l] = by_z * g.z_by_vx;
    shear->size_by[1][l] = by_z * g.z_by_vy;
    shear->size_by[2][l] = by_z * g.z_by_yaw;
  }
}

/* What the wheels make of the shear at one point. */
GROUSER_INLINE void weigh_point(const lane_row *stress, const double by[GROUSER_MAX_WHEELS][GROUSER_POINTS], int wheels,
                        int point, double *to) {
  GROUSER_LANE_LOOP
  for (int l = 0; l < LANES; l++) to[l] = 0;
  for (int i = 0; i < wheels; i++) {
    const double gain = by[i][point];
    GROUSER_LANE_LOOP
    for (int l = 0; l < LANES; l++) to[l] += stress[i][l] * gain;
  }
}

static void prepare_side(const grouser_track_net *net, const grouser_block_rows *rows, enum grouser_side side,
                         const lane_row *share, lane_row *prepared) {
  const grouser_physics *block = &net->block;
  const int columns = grouser_columns(block->mode);
  const double *belt = grouser_belt_in(rows, side);
  const double *modulus = rows->column[columns - 1], *rolling = rows->column[columns - 2];
  lane_row load;
  grouser_load_block(block, rows, side, share, load, prepared + STRESS);
  GROUSER_LANE_LOOP
  for (int l = 0; l < LANES; l++) {
    const grouser_slip s = grouser_slip_of(0.0, 0.0, 0.0, belt[l], modulus[l], 0.0, 0.0, block->soft_speed);
    prepared[DIRECTION][l] = s.direction;
    prepared[PER_METER][l] = s.per_meter;
    prepared[RESISTANCE][l] = rolling[l] * load[l] * s.direction;
  }
  for (int j = 0; j < GROUSER_POINTS; j++) {
    weigh_point((const lane_row *)prepared + STRESS, net->mean, block->wheels, j, prepared[WEIGHT + j]);
    weigh_point((const lane_row *)prepared + STRESS, net->turning, block->wheels, j, prepared[MOMENT + j]);
  }
}

void grouser_track_net_prepare_block(const grouser_track_net *net, const grouser_block_rows *left,
                                     const grouser_block_rows *right, double (*prepared)[GROUSER_BLOCK]) {
  lane_row share[GROUSER_MAX_WHEELS];
  grouser_block_shares(&net->block, left, share);
  prepare_side(net, left, GROUSER_LEFT, (const lane_row *)share, prepared);
  if (right != left) grouser_block_shares(&net->block, right, share);
  prepare_side(net, right, GROUSER_RIGHT, (const lane_row *)share, prepared + side_rows(net));
}

/* Normalized features of one side, and their derivatives if wanted: rows of `stride` floats. */
GROUSER_INLINE void features_of_block(const grouser_track_net *net, const lane_row *prepared, const block_shear *shear,
                                      const int exact, float *in, size_t stride) {
  for (int f = 0; f < GROUSER_FEATURES; f++) {
    const double mean = net->input_mean[f], gain = net->input_gain[f];
    const double *value = f < GROUSER_POINTS   ? shear->x[f]
                          : f < GROUSER_SHEAR  ? shear->y[f - GROUSER_POINTS]
                          : f == GROUSER_SHEAR ? shear->size
                                               : prepared[DIRECTION];
    float *row = in + (size_t)f * stride;
    GROUSER_LANE_LOOP
    for (int l = 0; l < LANES; l++) row[l] = (float)((value[l] - mean) * gain);
    if (!exact) continue;
    for (int d = 0; d < GROUSER_SEEDS; d++) {
      float *slope = row + (1 + d) * LANES;
      if (f > GROUSER_SHEAR) {
        memset(slope, 0, sizeof(float) * LANES);
        continue;
      }
      const double *by = f < GROUSER_POINTS  ? shear->x_by[d][f]
                         : f < GROUSER_SHEAR ? shear->y_by[d][f - GROUSER_POINTS]
                                             : shear->size_by[d];
      GROUSER_LANE_LOOP
      for (int l = 0; l < LANES; l++) slope[l] = (float)(by[l] * gain);
    }
  }
}

/* Adds a track's forces: along, across and turning of the mirrored track, then signs and levers. */
GROUSER_INLINE void add_track(const grouser_track_net *net, enum grouser_side side, const lane_row *prepared,
                              const block_shear *shear, const float *y, size_t stride,
                              const enum grouser_slopes_wanted wanted, grouser_block_forces *out) {
  const grouser_physics *block = &net->block;
  const int wheels = block->wheels, exact = wanted == GROUSER_EXACT_SLOPES;
  const int parts = wanted == GROUSER_NO_SLOPES ? 1 : 1 + GROUSER_SEEDS, network_parts = exact ? parts : 1;
  const double sign = grouser_sign(side), half_tread = block->tread / 2, half = block->element_length / 2;
  lane_row sum[GROUSER_OUTPUTS][1 + GROUSER_SEEDS], force[GROUSER_OUTPUTS][1 + GROUSER_SEEDS];
  for (int n = 0; n < GROUSER_OUTPUTS; n++) memset(sum[n], 0, sizeof sum[n][0] * (size_t)network_parts);
  for (int i = 0; i < wheels; i++) {
    const double *stress = prepared[STRESS + i], arm = net->arm[i];
    for (int p = 0; p < network_parts; p++) {
      const float *along = y + (size_t)i * stride + (size_t)(p * LANES), *across = along + (size_t)wheels * stride;
      const float *turn = across + (size_t)wheels * stride;
      const double mean[3] = {p ? 0.0 : net->output_mean[i], p ? 0.0 : net->output_mean[wheels + i],
                              p ? 0.0 : net->output_mean[2 * wheels + i]};
      const double scale[3] = {net->output_scale[i], net->output_scale[wheels + i], net->output_scale[2 * wheels + i]};
      GROUSER_LANE_LOOP
      for (int l = 0; l < LANES; l++) {
        const double aside = mean[1] + scale[1] * (double)across[l];
        sum[0][p][l] += stress[l] * (mean[0] + scale[0] * (double)along[l]);
        sum[1][p][l] += stress[l] * aside;
        sum[2][p][l] += stress[l] * (arm * aside + half * (mean[2] + scale[2] * (double)turn[l]));
      }
    }
  }
  for (int n = 0; n < GROUSER_OUTPUTS; n++)
    for (int p = 0; p < parts; p++) {
      const double *points = p == 0 ? (n == 0 ? shear->x[0] : shear->y[0])
                                    : (n == 0 ? shear->x_by[p - 1][0] : shear->y_by[p - 1][0]);
      const double *by = prepared[n == 2 ? MOMENT : WEIGHT];
      GROUSER_LANE_LOOP
      for (int l = 0; l < LANES; l++) {
        double value = p < network_parts ? shear->gate[l] * sum[n][p][l] : 0.0;
        if (exact && p > 0) value += shear->gate_by[p - 1][l] * sum[n][0][l];
        for (int j = 0; j < GROUSER_POINTS; j++) value += by[j * LANES + l] * points[j * LANES + l];
        force[n][p][l] = value;
      }
    }
  GROUSER_LANE_LOOP
  for (int l = 0; l < LANES; l++) force[0][0][l] -= prepared[RESISTANCE][l];
  for (int p = 0; p < parts; p++) {
    const double column_sign = p > 1 ? sign : 1.0;
    for (int n = 0; n < GROUSER_OUTPUTS; n++) {
      const double row_sign = n == 0 ? column_sign : sign * column_sign;
      double *to = p == 0 ? out->force[n] : out->slope[n][p - 1];
      GROUSER_LANE_LOOP
      for (int l = 0; l < LANES; l++)
        to[l] += row_sign * (n == 2 ? force[2][p][l] - half_tread * force[0][p][l] : force[n][p][l]);
    }
  }
}

GROUSER_INLINE void track_net_block(const grouser_track_net *net, const grouser_block_rows *left,
                                    const grouser_block_rows *right, const lane_row *prepared,
                                    const enum grouser_slopes_wanted wanted, grouser_block_forces *out) {
  const int exact = wanted == GROUSER_EXACT_SLOPES;
  const grouser_block_rows *rows[BLOCK_SIDES] = {left, right};
  const lane_row *own[BLOCK_SIDES] = {prepared, prepared + side_rows(net)};
  static const enum grouser_side sides[BLOCK_SIDES] = {GROUSER_LEFT, GROUSER_RIGHT};
  block_shear shear[BLOCK_SIDES];
  float in[GROUSER_FEATURES * GROUSER_DUAL], result[BLOCK_SIDES * GROUSER_MAX_UNITS * GROUSER_DUAL];
  float scratch[2 * GROUSER_MAX_WIDTH * GROUSER_DUAL];
  const size_t stride = exact ? (size_t)GROUSER_DUAL : (size_t)(BLOCK_SIDES * LANES);
  const size_t step = exact ? (size_t)(grouser_padded(3 * net->block.wheels) * GROUSER_DUAL) : (size_t)LANES;
  memset(out->force, 0, sizeof out->force);
  if (wanted != GROUSER_NO_SLOPES) memset(out->slope, 0, sizeof out->slope);
  for (int k = 0; k < BLOCK_SIDES; k++) {
    float *to = exact ? in : in + k * LANES;
    slip_of_block(net, rows[k], sides[k], &shear[k]);
    shear_of_block(net, own[k], wanted, &shear[k]);
    features_of_block(net, own[k], &shear[k], exact, to, stride);
    if (exact) grouser_dense_block(&net->dense, in, result + (size_t)k * step, scratch);
  }
  if (!exact) grouser_dense_batch(&net->dense, in, BLOCK_SIDES * LANES, result, scratch);
  for (int k = 0; k < BLOCK_SIDES; k++)
    add_track(net, sides[k], own[k], &shear[k], result + (size_t)k * step, stride, wanted, out);
}

void grouser_track_net_block(const grouser_track_net *net, const grouser_block_rows *left,
                             const grouser_block_rows *right, const double (*prepared)[GROUSER_BLOCK],
                             enum grouser_slopes_wanted wanted, grouser_block_forces *out) {
  if (wanted == GROUSER_EXACT_SLOPES)
    track_net_block(net, left, right, prepared, GROUSER_EXACT_SLOPES, out);
  else if (wanted == GROUSER_LEADING_SLOPES)
    track_net_block(net, left, right, prepared, GROUSER_LEADING_SLOPES, out);
  else
    track_net_block(net, left, right, prepared, GROUSER_NO_SLOPES, out);
}
