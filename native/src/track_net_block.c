#include <math.h>
#include <string.h>

#include "grouser/track_net.h"
#include "load.h"
#include "shear_point.h"

/* The structured surrogate for a block of vehicles, lane by lane: the same equations as for one, the same loops over
 * points and wheels, each around a loop over lanes. */

enum { LANES = GROUSER_BLOCK, BLOCK_SIDES = 2 };

typedef double lane_row[LANES];

typedef struct {
  lane_row along, across, yaw_rate, soft_belt, direction, direction_slope, per_meter, modulus;
} block_slip;

/* Shear, gate, and their derivatives by the mirrored vx, vy and yaw rate. */
typedef struct {
  lane_row x[GROUSER_POINTS], y[GROUSER_POINTS], x_by[GROUSER_SEEDS][GROUSER_POINTS], y_by[GROUSER_SEEDS][GROUSER_POINTS];
  lane_row gate, gate_by[GROUSER_SEEDS], size, size_by[GROUSER_SEEDS];
} block_shear;

typedef struct {
  lane_row load, stress[GROUSER_MAX_WHEELS]; /* in N */
} block_load;

static void block_slip_of(const grouser_track_net *net, const grouser_block_rows *rows, enum grouser_side side,
                          block_slip *slip) {
  const grouser_physics *block = &net->block;
  const double sign = side == GROUSER_LEFT ? 1.0 : -1.0;
  const double *belt = rows->column[side == GROUSER_LEFT ? GROUSER_V_LEFT : GROUSER_V_RIGHT];
  const double *modulus = rows->column[grouser_columns(block->mode) - 1];
  for (int l = 0; l < LANES; l++) {
    const grouser_slip s =
        grouser_slip_of(rows->column[GROUSER_VX][l], sign * rows->column[GROUSER_VY][l],
                        sign * rows->column[GROUSER_YAW_RATE][l], belt[l], modulus[l], block->tread / 2,
                        block->contact_center, block->soft_speed);
    slip->along[l] = s.along;
    slip->across[l] = s.across;
    slip->yaw_rate[l] = s.yaw_rate;
    slip->soft_belt[l] = s.soft_belt;
    slip->direction[l] = s.direction;
    slip->direction_slope[l] = s.direction_slope;
    slip->per_meter[l] = s.per_meter;
    slip->modulus[l] = s.modulus;
  }
}

GROUSER_INLINE grouser_slip lane_slip(const block_slip *slip, int l) {
  const grouser_slip s = {slip->along[l],           slip->across[l],    slip->yaw_rate[l], slip->soft_belt[l], slip->direction[l],
                          slip->direction_slope[l], slip->per_meter[l], slip->modulus[l]};
  return s;
}

GROUSER_INLINE void block_shear_of(const grouser_track_net *net, const block_slip *slip,
                                   const enum grouser_slopes_wanted wanted, block_shear *shear) {
  const grouser_physics *block = &net->block;
  for (int j = 0; j < GROUSER_POINTS; j++) {
    const grouser_part part = part_of(net, j);
    for (int l = 0; l < LANES; l++) {
      const grouser_shear_point p = grouser_shear_at(lane_slip(slip, l), part);
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
  for (int l = 0; l < LANES; l++) {
    const grouser_gate g = grouser_gate_of(lane_slip(slip, l), block->tread / 2, block->contact_center,
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

/* As grouser_element_shares. */
static void block_shares_of(const grouser_track_net *net, const grouser_block_rows *rows, lane_row *share) {
  const grouser_physics *block = &net->block;
  const int count = block->wheels;
  const double lean_slope = -block->cg_height / block->gravity;
  double spread = 0;
  lane_row total;
  for (int i = 0; i < count; i++) spread += grouser_element_arm(block, i) * grouser_element_arm(block, i);
  for (int l = 0; l < LANES; l++) total[l] = 0;
  for (int i = 0; i < count; i++) {
    const double gain = spread > 0 ? grouser_element_arm(block, i) / spread : 0.0;
    for (int l = 0; l < LANES; l++) {
      const double lean = lean_slope * rows->column[GROUSER_AX][l] - block->contact_center;
      const double raw = 1.0 / count + gain * lean;
      /* A raw share that is not a number passes. */
      share[i][l] = raw < 0 ? 0.0 : raw;
      total[l] += share[i][l];
    }
  }
  for (int i = 0; i < count; i++)
    for (int l = 0; l < LANES; l++) share[i][l] /= total[l];
}

/* As grouser_side_load and grouser_shear_strength. */
static void block_load_of(const grouser_track_net *net, const grouser_block_rows *rows, enum grouser_side side,
                          const lane_row *share, block_load *t) {
  const grouser_physics *block = &net->block;
  const int count = block->wheels;
  const double area = block->element_length * block->track_width, weight = block->mass * block->gravity;
  const double transfer = (side == GROUSER_LEFT ? -1.0 : 1.0) * (block->mass * block->cg_height / block->tread);
  const double *strength = rows->column[GROUSER_TERRAIN], *angle = rows->column[GROUSER_TERRAIN + 1];
  for (int l = 0; l < LANES; l++) {
    const double load = weight / 2 + transfer * rows->column[GROUSER_AY][l];
    t->load[l] = load < 0 ? 0.0 : load > weight ? weight : load;
  }
  if (block->mode == GROUSER_RIGID) {
    for (int i = 0; i < count; i++)
      for (int l = 0; l < LANES; l++) t->stress[i][l] = strength[l] * (t->load[l] * share[i][l] / area) * area;
    return;
  }
  lane_row tangent;
  const double full_contact = GROUSER_COHESION_FADE * block->mass * block->gravity / (2 * count);
  /* Vehicles mostly share their ground, and the tangent is the dearest part. */
  for (int l = 0; l < LANES; l++) tangent[l] = l > 0 && angle[l] == angle[l - 1] ? tangent[l - 1] : tan(angle[l]);
  for (int i = 0; i < count; i++)
    for (int l = 0; l < LANES; l++) {
      const double load = t->load[l] * share[i][l], pressure = load / area;
      const double fade = load < full_contact ? load / full_contact : 1.0;
      t->stress[i][l] = (strength[l] * fade + pressure * tangent[l]) * area;
    }
}

/* Normalized features of one side, and their derivatives if wanted: rows of `stride` floats. */
GROUSER_INLINE void block_features(const grouser_track_net *net, const block_slip *slip, const block_shear *shear,
                                   const int exact, float *in, size_t stride) {
  for (int f = 0; f < GROUSER_FEATURES; f++) {
    const double mean = net->input_mean[f], gain = net->input_gain[f];
    const double *value = f < GROUSER_POINTS   ? shear->x[f]
                          : f < GROUSER_SHEAR  ? shear->y[f - GROUSER_POINTS]
                          : f == GROUSER_SHEAR ? shear->size
                                               : slip->direction;
    float *row = in + (size_t)f * stride;
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
      for (int l = 0; l < LANES; l++) slope[l] = (float)(by[l] * gain);
    }
  }
}

/* What the wheels make of the shear at one point. One point at a time, since compilers mix up the points of a wheel. */
GROUSER_INLINE void weigh_point(const block_load *t, const double by[GROUSER_MAX_WHEELS][GROUSER_POINTS], int wheels,
                                int point, double *to) {
  for (int l = 0; l < LANES; l++) to[l] = 0;
  for (int i = 0; i < wheels; i++) {
    const double *stress = t->stress[i], gain = by[i][point];
    for (int l = 0; l < LANES; l++) to[l] += stress[l] * gain;
  }
}

/* Adds a track's forces: along, across and turning of the mirrored track, then signs and levers. */
GROUSER_INLINE void add_track(const grouser_track_net *net, const grouser_block_rows *rows, enum grouser_side side,
                              const block_slip *slip, const block_shear *shear, const block_load *t, const float *y,
                              size_t stride, const enum grouser_slopes_wanted wanted, grouser_block_forces *out) {
  const grouser_physics *block = &net->block;
  const int wheels = block->wheels, columns = grouser_columns(block->mode), exact = wanted == GROUSER_EXACT_SLOPES;
  const int parts = wanted == GROUSER_NO_SLOPES ? 1 : 1 + GROUSER_SEEDS, network_parts = exact ? parts : 1;
  const double sign = side == GROUSER_LEFT ? 1.0 : -1.0, half_tread = block->tread / 2, half = block->element_length / 2;
  const double *rolling = rows->column[columns - 2];
  lane_row sum[GROUSER_OUTPUTS][1 + GROUSER_SEEDS], force[GROUSER_OUTPUTS][1 + GROUSER_SEEDS];
  lane_row weight[GROUSER_POINTS], moment[GROUSER_POINTS];
  for (int n = 0; n < GROUSER_OUTPUTS; n++) memset(sum[n], 0, sizeof sum[n][0] * (size_t)network_parts);
  for (int j = 0; j < GROUSER_POINTS; j++) {
    weigh_point(t, net->mean, wheels, j, weight[j]);
    weigh_point(t, net->turning, wheels, j, moment[j]);
  }
  for (int i = 0; i < wheels; i++) {
    const double *stress = t->stress[i], arm = net->arm[i];
    for (int p = 0; p < network_parts; p++) {
      const float *along = y + (size_t)i * stride + (size_t)(p * LANES), *across = along + (size_t)wheels * stride;
      const float *turn = across + (size_t)wheels * stride;
      const double mean[3] = {p ? 0.0 : net->output_mean[i], p ? 0.0 : net->output_mean[wheels + i],
                              p ? 0.0 : net->output_mean[2 * wheels + i]};
      const double scale[3] = {net->output_scale[i], net->output_scale[wheels + i], net->output_scale[2 * wheels + i]};
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
      const double *by = n == 2 ? moment[0] : weight[0];
      for (int l = 0; l < LANES; l++) {
        double value = p < network_parts ? shear->gate[l] * sum[n][p][l] : 0.0;
        if (exact && p > 0) value += shear->gate_by[p - 1][l] * sum[n][0][l];
        for (int j = 0; j < GROUSER_POINTS; j++) value += by[j * LANES + l] * points[j * LANES + l];
        force[n][p][l] = value;
      }
    }
  for (int l = 0; l < LANES; l++) force[0][0][l] -= rolling[l] * t->load[l] * slip->direction[l];
  for (int p = 0; p < parts; p++) {
    const double column_sign = p > 1 ? sign : 1.0;
    for (int n = 0; n < GROUSER_OUTPUTS; n++) {
      const double row_sign = n == 0 ? column_sign : sign * column_sign;
      double *to = p == 0 ? out->force[n] : out->slope[n][p - 1];
      for (int l = 0; l < LANES; l++)
        to[l] += row_sign * (n == 2 ? force[2][p][l] - half_tread * force[0][p][l] : force[n][p][l]);
    }
  }
}

GROUSER_INLINE void track_net_block(const grouser_track_net *net, const grouser_block_rows *left,
                                    const grouser_block_rows *right, const enum grouser_slopes_wanted wanted,
                                    grouser_block_forces *out) {
  const int exact = wanted == GROUSER_EXACT_SLOPES;
  const grouser_block_rows *rows[BLOCK_SIDES] = {left, right};
  static const enum grouser_side sides[BLOCK_SIDES] = {GROUSER_LEFT, GROUSER_RIGHT};
  block_slip slip[BLOCK_SIDES];
  block_shear shear[BLOCK_SIDES];
  block_load load;
  lane_row share[GROUSER_MAX_WHEELS];
  float in[GROUSER_FEATURES * GROUSER_DUAL], result[BLOCK_SIDES * GROUSER_MAX_UNITS * GROUSER_DUAL];
  float scratch[2 * GROUSER_MAX_WIDTH * GROUSER_DUAL];
  const size_t stride = exact ? (size_t)GROUSER_DUAL : (size_t)(BLOCK_SIDES * LANES);
  memset(out->force, 0, sizeof out->force);
  if (wanted != GROUSER_NO_SLOPES) memset(out->slope, 0, sizeof out->slope);
  for (int k = 0; k < BLOCK_SIDES; k++) {
    float *to = exact ? in : in + k * LANES;
    float *y = exact ? result + (size_t)k * (size_t)(grouser_padded(3 * net->block.wheels) * GROUSER_DUAL) : result + k * LANES;
    block_slip_of(net, rows[k], sides[k], &slip[k]);
    block_shear_of(net, &slip[k], wanted, &shear[k]);
    block_features(net, &slip[k], &shear[k], exact, to, stride);
    if (exact) grouser_dense_block(&net->dense, in, y, scratch);
  }
  if (!exact) grouser_dense_batch(&net->dense, in, BLOCK_SIDES * LANES, result, scratch);
  for (int k = 0; k < BLOCK_SIDES; k++) {
    const float *y = exact ? result + (size_t)k * (size_t)(grouser_padded(3 * net->block.wheels) * GROUSER_DUAL) : result + k * LANES;
    if (k == 0 || rows[k] != rows[0]) block_shares_of(net, rows[k], share);
    block_load_of(net, rows[k], sides[k], (const lane_row *)share, &load);
    add_track(net, rows[k], sides[k], &slip[k], &shear[k], &load, y, stride, wanted, out);
  }
}

void grouser_track_net_block(const grouser_track_net *net, const grouser_block_rows *left,
                             const grouser_block_rows *right, enum grouser_slopes_wanted wanted,
                             grouser_block_forces *out) {
  if (wanted == GROUSER_EXACT_SLOPES)
    track_net_block(net, left, right, GROUSER_EXACT_SLOPES, out);
  else if (wanted == GROUSER_LEADING_SLOPES)
    track_net_block(net, left, right, GROUSER_LEADING_SLOPES, out);
  else
    track_net_block(net, left, right, GROUSER_NO_SLOPES, out);
}
