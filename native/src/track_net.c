#include "grouser/track_net.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "load.h"
#include "shear_point.h"

/* What a track's shear is differentiated by: columns of the mirrored track, then the shear modulus. */
enum { BY_VX, BY_VY, BY_YAW_RATE, BY_BELT, BY_MODULUS, DIRECTIONS };
enum { SIDES = 2, PLACES = SIDES * GROUSER_POINTS };

static grouser_part part_of(const grouser_track_net *net, int point) {
  const grouser_physics *block = &net->block;
  grouser_part p;
  p.half_tread = block->tread / 2;
  p.center = block->contact_center;
  p.width_square = block->track_width * block->track_width / 12;
  p.rear = net->ends[point];
  p.front = net->ends[GROUSER_POINTS + point];
  p.reach = net->reach[point];
  p.half_travel = net->half_travel;
  p.part_square = net->part_length * net->part_length / 12;
  return p;
}

/* The load of a track, the strength under its elements, and what they make of the shear at the points. */
typedef struct {
  double load, load_by_ay, rolling;
  const double *share, *share_by_ax; /* by element */
  double stress[GROUSER_MAX_WHEELS]; /* in N */
  grouser_strength strength[GROUSER_MAX_WHEELS];
  double force[GROUSER_POINTS], moment[GROUSER_POINTS];
} track_load;

GROUSER_INLINE void load_track(const grouser_track_net *net, const double *x, enum grouser_side side, double tangent,
                               const int want_slopes, track_load *t) {
  const grouser_physics *block = &net->block;
  const double area = block->element_length * block->track_width;
  t->rolling = x[grouser_columns(block->mode) - 2];
  t->load = grouser_side_load(block, x[GROUSER_AY], side, &t->load_by_ay);
  for (int j = 0; j < GROUSER_POINTS; j++) t->force[j] = t->moment[j] = 0;
  for (int i = 0; i < block->wheels; i++) {
    const grouser_strength s = grouser_shear_strength(block, x + GROUSER_TERRAIN, tangent, t->load * t->share[i]);
    t->stress[i] = s.stress * area;
    if (want_slopes) t->strength[i] = s;
    for (int j = 0; j < GROUSER_POINTS; j++) {
      t->force[j] += t->stress[i] * net->mean[i][j];
      t->moment[j] += t->stress[i] * net->turning[i][j];
    }
  }
}

/* Slip, shear and gate of one or two tracks, place by place: the points of the first, then those of the second. */
typedef struct {
  grouser_slip slip[SIDES];
  grouser_gate gate[SIDES];
  double x[PLACES], x_by[DIRECTIONS][PLACES], y[PLACES], y_by[DIRECTIONS][PLACES];
} track_shear;

GROUSER_INLINE void shear_tracks(const grouser_track_net *net, const double *row,
                                 const enum grouser_side side[SIDES], int sides, const int want_slopes,
                                 track_shear *shear) {
  const grouser_physics *block = &net->block;
  double along[PLACES], across[PLACES], yaw_rate[PLACES], soft_belt[PLACES], direction[PLACES], direction_slope[PLACES];
  double per_meter[PLACES], modulus[PLACES], rear[PLACES], front[PLACES], reach[PLACES];
  for (int k = 0; k < SIDES; k++) {
    const int from = k < sides ? k : 0;
    const double sign = side[from] == GROUSER_LEFT ? 1.0 : -1.0;
    const grouser_slip s = grouser_slip_of(
        row[GROUSER_VX], sign * row[GROUSER_VY], sign * row[GROUSER_YAW_RATE],
        row[side[from] == GROUSER_LEFT ? GROUSER_V_LEFT : GROUSER_V_RIGHT], row[grouser_columns(block->mode) - 1],
        block->tread / 2, block->contact_center, block->soft_speed);
    shear->slip[k] = s;
    shear->gate[k] =
        grouser_gate_of(s, block->tread / 2, block->contact_center, block->contact_length / 2, net->half_travel);
    for (int j = 0; j < GROUSER_POINTS; j++) {
      const int q = k * GROUSER_POINTS + j;
      along[q] = s.along;
      across[q] = s.across;
      yaw_rate[q] = s.yaw_rate;
      soft_belt[q] = s.soft_belt;
      direction[q] = s.direction;
      direction_slope[q] = s.direction_slope;
      per_meter[q] = s.per_meter;
      modulus[q] = s.modulus;
      rear[q] = net->ends[j];
      front[q] = net->ends[GROUSER_POINTS + j];
      reach[q] = net->reach[j];
    }
  }
  const grouser_part part = part_of(net, 0);
  for (int q = 0; q < PLACES; q++) {
    const grouser_slip s = {along[q],     across[q],          yaw_rate[q],  soft_belt[q],
                            direction[q], direction_slope[q], per_meter[q], modulus[q]};
    const grouser_part p = {part.half_tread, part.center, part.width_square, rear[q],
                            front[q],        reach[q],    part.half_travel,  part.part_square};
    const grouser_shear_point j = grouser_shear_at(s, p);
    shear->x[q] = j.x;
    shear->y[q] = j.y;
    if (!want_slopes) continue;
    shear->x_by[BY_VX][q] = j.x_by_vx;
    shear->x_by[BY_VY][q] = j.x_by_vy;
    shear->x_by[BY_YAW_RATE][q] = j.x_by_yaw;
    shear->x_by[BY_BELT][q] = j.x_by_belt;
    shear->x_by[BY_MODULUS][q] = j.x_by_modulus;
    shear->y_by[BY_VX][q] = j.y_by_vx;
    shear->y_by[BY_VY][q] = j.y_by_vy;
    shear->y_by[BY_YAW_RATE][q] = j.y_by_yaw;
    shear->y_by[BY_BELT][q] = j.y_by_belt;
    shear->y_by[BY_MODULUS][q] = j.y_by_modulus;
  }
}

/* [Fx, Fy, M] of a mirrored track as sums over units: coefficient of unit `u` at unit strength. */
static double lever(const grouser_track_net *net, int component, int unit) {
  const grouser_physics *block = &net->block;
  const int element = unit % block->wheels, kind = unit / block->wheels;
  if (component < 2) return kind == component ? 1.0 : 0.0;
  if (kind == 0) return -block->tread / 2;
  return kind == 1 ? net->arm[element] : block->element_length / 2;
}

/* The network's inputs of one track. */
static void read_features(const grouser_track_net *net, const track_shear *shear, int k, float *input) {
  double feature[GROUSER_FEATURES];
  for (int j = 0; j < GROUSER_POINTS; j++) {
    feature[j] = shear->x[k * GROUSER_POINTS + j];
    feature[GROUSER_POINTS + j] = shear->y[k * GROUSER_POINTS + j];
  }
  feature[GROUSER_SHEAR] = shear->gate[k].z / (shear->gate[k].z + 4);
  feature[GROUSER_SHEAR + 1] = shear->slip[k].direction;
  for (int f = 0; f < GROUSER_FEATURES; f++) input[f] = (float)((feature[f] - net->input_mean[f]) * net->input_gain[f]);
}

static void read_correction(const grouser_track_net *net, const float *output, double *correction) {
  for (int u = 0; u < 3 * net->block.wheels; u++)
    correction[u] = net->output_mean[u] + net->output_scale[u] * (double)output[u];
}

static void track_force(const grouser_track_net *net, const track_shear *shear, int k, enum grouser_side side,
                        const track_load *t, const double *correction, double force[GROUSER_OUTPUTS]) {
  const grouser_physics *block = &net->block;
  const int wheels = block->wheels;
  double along = 0, across = 0, moment = 0;
  for (int i = 0; i < wheels; i++) {
    const double stress = t->stress[i];
    along += stress * correction[i];
    across += stress * correction[wheels + i];
    moment += stress * (net->arm[i] * correction[wheels + i] +
                        block->element_length / 2 * correction[2 * wheels + i]);
  }
  double fx = shear->gate[k].gate * along;
  double fy = shear->gate[k].gate * across, turning = shear->gate[k].gate * moment;
  for (int j = 0; j < GROUSER_POINTS; j++) {
    fx += t->force[j] * shear->x[k * GROUSER_POINTS + j];
    fy += t->force[j] * shear->y[k * GROUSER_POINTS + j];
    turning += t->moment[j] * shear->y[k * GROUSER_POINTS + j];
  }
  fx -= t->rolling * t->load * shear->slip[k].direction;
  const double sign = side == GROUSER_LEFT ? 1.0 : -1.0;
  force[0] = fx;
  force[1] = sign * fy;
  force[2] = sign * (turning - block->tread / 2 * fx);
}

static void track_jacobian(const grouser_track_net *net, const track_shear *shear, int k, enum grouser_side side,
                           const track_load *t, const double *correction, grouser_slopes slopes, double *jacobian) {
  const grouser_physics *block = &net->block;
  const grouser_gate *gate = &shear->gate[k];
  const int columns = grouser_columns(block->mode), wheels = block->wheels, units = 3 * wheels;
  const double half_tread = block->tread / 2, area = block->element_length * block->track_width;
  const double *x = shear->x + k * GROUSER_POINTS, *y = shear->y + k * GROUSER_POINTS;
  float rows[GROUSER_SEEDS * GROUSER_MAX_WIDTH];
  double by_gate[GROUSER_OUTPUTS] = {0, 0, 0};
  for (int n = 0; n < GROUSER_OUTPUTS; n++)
    for (int u = 0; u < units; u++) {
      const double seed = t->stress[u % wheels] * lever(net, n, u);
      rows[n * GROUSER_MAX_WIDTH + u] = (float)(seed * gate->gate * net->output_scale[u]);
      by_gate[n] += seed * correction[u];
    }
  grouser_dense_backward(&net->dense, slopes, rows);

  /* Rows and columns that change their sign between a track and its mirror image. */
  const double sign = side == GROUSER_LEFT ? 1.0 : -1.0;
  const int belt_column = side == GROUSER_LEFT ? GROUSER_V_LEFT : GROUSER_V_RIGHT;
  const int column[DIRECTIONS] = {GROUSER_VX, GROUSER_VY, GROUSER_YAW_RATE, belt_column, columns - 1};
  const double column_sign[DIRECTIONS] = {1, sign, sign, 1, 1};
  const double z_by[DIRECTIONS] = {gate->z_by_vx, gate->z_by_vy, gate->z_by_yaw, gate->z_by_belt, gate->z_by_modulus};
  const double size_by_z = 4 / ((gate->z + 4) * (gate->z + 4));
  memset(jacobian, 0, sizeof(double) * GROUSER_OUTPUTS * (size_t)columns);
  for (int n = 0; n < GROUSER_OUTPUTS; n++) {
    double *slope = jacobian + n * columns, by_feature[GROUSER_FEATURES], by_x[GROUSER_POINTS], by_y[GROUSER_POINTS];
    const double row_sign = n == 0 ? 1.0 : sign;
    const double along_lever = n == 0 ? 1.0 : n == 2 ? -half_tread : 0.0;
    const double by_direction = -along_lever * t->rolling * t->load;
    for (int f = 0; f < GROUSER_FEATURES; f++)
      by_feature[f] = (double)rows[n * GROUSER_MAX_WIDTH + f] * net->input_gain[f];
    for (int j = 0; j < GROUSER_POINTS; j++) {
      by_x[j] = by_feature[j] + along_lever * t->force[j];
      by_y[j] = by_feature[GROUSER_POINTS + j] + (n == 1 ? t->force[j] : n == 2 ? t->moment[j] : 0.0);
    }
    const double by_z = by_gate[n] * gate->gate_by_z + by_feature[GROUSER_SHEAR] * size_by_z;
    for (int q = 0; q < DIRECTIONS; q++) {
      double sum = by_z * z_by[q];
      if (q == BY_BELT) sum += (by_direction + by_feature[GROUSER_SHEAR + 1]) * shear->slip[k].direction_slope;
      for (int j = 0; j < GROUSER_POINTS; j++)
        sum += by_x[j] * shear->x_by[q][k * GROUSER_POINTS + j] + by_y[j] * shear->y_by[q][k * GROUSER_POINTS + j];
      slope[column[q]] = row_sign * column_sign[q] * sum;
    }
    slope[GROUSER_AY] = -row_sign * along_lever * t->rolling * t->load_by_ay * shear->slip[k].direction;
    slope[columns - 2] = -row_sign * along_lever * t->load * shear->slip[k].direction;
    for (int i = 0; i < wheels; i++) {
      const grouser_strength s = t->strength[i];
      double along = gate->gate * correction[i], across = gate->gate * correction[wheels + i];
      double turning = gate->gate * (net->arm[i] * correction[wheels + i] +
                                     block->element_length / 2 * correction[2 * wheels + i]);
      for (int j = 0; j < GROUSER_POINTS; j++) {
        along += net->mean[i][j] * x[j];
        across += net->mean[i][j] * y[j];
        turning += net->turning[i][j] * y[j];
      }
      const double unit = n == 0 ? along : n == 1 ? across : turning - half_tread * along;
      const double gain = row_sign * area * unit;
      slope[GROUSER_AX] += gain * s.by_load * t->load * t->share_by_ax[i];
      slope[GROUSER_AY] += gain * s.by_load * t->load_by_ay * t->share[i];
      for (int p = 0; p < columns - GROUSER_TERRAIN - 2; p++) slope[GROUSER_TERRAIN + p] += gain * s.by_parameter[p];
    }
  }
}

GROUSER_INLINE void evaluate_sides(const grouser_track_net *net, const double *x,
                                   const enum grouser_side side[SIDES], int sides, const int want_slopes,
                                   double force[SIDES][GROUSER_OUTPUTS], double *const jacobian[SIDES]) {
  double share[GROUSER_MAX_WHEELS], share_by_ax[GROUSER_MAX_WHEELS];
  track_shear shear;
  shear_tracks(net, x, side, sides, want_slopes, &shear);
  grouser_element_shares(&net->block, x[GROUSER_AX], share, share_by_ax);
  const double tangent = grouser_friction_tangent(&net->block, x + GROUSER_TERRAIN);
  float input[SIDES * GROUSER_MAX_WIDTH], output[SIDES * GROUSER_MAX_WIDTH];
  grouser_slopes slopes[SIDES];
  for (int k = 0; k < sides; k++) read_features(net, &shear, k, input + k * GROUSER_MAX_WIDTH);
  (sides == 1 ? grouser_dense_forward : grouser_dense_forward_pair)(&net->dense, input, output,
                                                                    want_slopes ? slopes : NULL);
  for (int k = 0; k < sides; k++) {
    track_load load;
    double correction[GROUSER_MAX_UNITS];
    load.share = share;
    load.share_by_ax = share_by_ax;
    load_track(net, x, side[k], tangent, want_slopes, &load);
    read_correction(net, output + k * GROUSER_MAX_WIDTH, correction);
    track_force(net, &shear, k, side[k], &load, correction, force[k]);
    if (want_slopes) track_jacobian(net, &shear, k, side[k], &load, correction, slopes[k], jacobian[k]);
  }
}

/* Both sides are of one row, so that what does not know them apart is computed once. */
static void evaluate_either(const grouser_track_net *net, const double *x, const enum grouser_side side[SIDES], int sides,
                     double force[SIDES][GROUSER_OUTPUTS], double *const jacobian[SIDES]) {
  if (jacobian[0])
    evaluate_sides(net, x, side, sides, 1, force, jacobian);
  else
    evaluate_sides(net, x, side, sides, 0, force, jacobian);
}

void grouser_track_net_prepare(grouser_track_net *net) {
  for (int i = 0; i < net->block.wheels; i++)
    for (int j = 0; j < GROUSER_POINTS; j++) {
      net->arm[i] = net->block.contact_center + grouser_element_arm(&net->block, i);
      net->turning[i][j] = net->arm[i] * net->mean[i][j] + net->block.element_length / 2 * net->moment[i][j];
    }
  for (int f = 0; f < GROUSER_FEATURES; f++) net->input_gain[f] = 1.0 / net->input_scale[f];
}

void grouser_track_net_track(const grouser_track_net *net, const double *x, enum grouser_side side,
                             double force[GROUSER_OUTPUTS], double *jacobian) {
  const enum grouser_side sides[SIDES] = {side, side};
  double *const jacobians[SIDES] = {jacobian, NULL};
  double forces[SIDES][GROUSER_OUTPUTS];
  evaluate_either(net, x, sides, 1, forces, jacobians);
  memcpy(force, forces[0], sizeof forces[0]);
}

void grouser_track_net_forces(const grouser_track_net *net, const double *x, double force[GROUSER_OUTPUTS],
                              double *jacobian) {
  const int entries = GROUSER_OUTPUTS * grouser_columns(net->block.mode);
  const enum grouser_side sides[SIDES] = {GROUSER_LEFT, GROUSER_RIGHT};
  double right_jacobian[GROUSER_OUTPUTS * GROUSER_MAX_COLUMNS], forces[SIDES][GROUSER_OUTPUTS];
  double *const jacobians[SIDES] = {jacobian, jacobian ? right_jacobian : NULL};
  evaluate_either(net, x, sides, SIDES, forces, jacobians);
  for (int n = 0; n < GROUSER_OUTPUTS; n++) force[n] = forces[0][n] + forces[1][n];
  if (jacobian)
    for (int n = 0; n < entries; n++) jacobian[n] += right_jacobian[n];
}
