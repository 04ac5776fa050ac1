#include "grouser/physics.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "cells.h"
#include "load.h"

static const char *const RIGID_COLUMNS[] = {GROUSER_RIGID_COLUMNS};
static const char *const SOIL_COLUMNS[] = {GROUSER_SOIL_COLUMNS};

static void fill_strip(const grouser_physics *block, double sign, int first, grouser_cell_strip *strip) {
  const int cells = block->along * block->across;
  const double length = block->element_length;
  const int count = cells - first < GROUSER_STRIP ? cells - first : GROUSER_STRIP;
  strip->count = count;
  strip->lanes = (count + GROUSER_LANES - 1) / GROUSER_LANES * GROUSER_LANES;
  for (int n = 0; n < strip->lanes; n++) {
    const int cell = n < count ? first + n : first;
    const int i = cell / block->across, j = cell % block->across;
    strip->offset[n] = ((i + 0.5) / block->along - 0.5) * length;
    strip->y[n] = sign * (block->tread / 2 + ((j + 0.5) / block->across - 0.5) * block->track_width);
    strip->weight[n] = n < count ? 1.0 : 0.0;
  }
}

static void place_element(const grouser_physics *block, int i, grouser_element_motion *m) {
  const double arm = grouser_element_arm(block, i);
  m->center = block->contact_center + arm;
  m->reach = block->contact == GROUSER_CONTINUOUS ? arm : 0.0;
}

/* Sums of every element of one track. */
static void integrate_track(const grouser_physics *block, const double *row, double belt, double sign,
                            enum grouser_wanted wanted, grouser_element_sums *sums) {
  const double soft_square = block->soft_speed * block->soft_speed;
  const int continuous = block->contact == GROUSER_CONTINUOUS;
  const int exact = block->path == GROUSER_EXACT_PATH;
  grouser_element_motion m;
  m.vx = row[GROUSER_VX];
  m.vy = row[GROUSER_VY];
  m.yaw_rate = row[GROUSER_YAW_RATE];
  m.belt = belt;
  m.half_travel = (continuous ? block->contact_length : block->element_length) / 2;
  m.soft_belt = sqrt(belt * belt + soft_square);
  m.modulus = row[grouser_columns(block->mode) - 1];
  m.direction = belt / m.soft_belt;
  m.direction_slope = soft_square / (m.soft_belt * m.soft_belt * m.soft_belt);
  memset(sums, 0, sizeof *sums * (size_t)block->wheels);
  const int cells = block->along * block->across, single = block->precision == GROUSER_SINGLE;
  for (int first = 0; single && first < cells; first += GROUSER_SINGLE_STRIP) {
    grouser_single_strip strip;
    grouser_fill_single_strip(block, first, &strip);
    for (int i = 0; i < block->wheels; i++) {
      place_element(block, i, &m);
      grouser_single_cells(&m, &strip, sign * block->tread / 2, wanted, &sums[i]);
    }
  }
  for (int first = 0; !single && first < cells; first += GROUSER_STRIP) {
    grouser_cell_strip strip;
    fill_strip(block, sign, first, &strip);
    for (int i = 0; i < block->wheels; i++) {
      place_element(block, i, &m);
      /* Forces come from their own pass, so that they have the same bits with and without slopes. */
      (exact ? grouser_exact_forces : grouser_soft_forces)(&m, &strip, &sums[i]);
      if (wanted != GROUSER_FORCES_WANTED)
        (exact ? grouser_exact_slopes : grouser_soft_slopes)(&m, &strip, wanted, &sums[i]);
    }
  }
}

void grouser_physics_track(const grouser_physics *block, const double *x, enum grouser_side side,
                           double force[GROUSER_OUTPUTS], double *jacobian) {
  const int columns = grouser_columns(block->mode);
  const double *terrain = x + GROUSER_TERRAIN;
  const double rolling = x[columns - 2];
  const int belt_column = side == GROUSER_LEFT ? GROUSER_V_LEFT : GROUSER_V_RIGHT;
  const int strength_columns = columns - GROUSER_TERRAIN - 2;
  const double belt = x[belt_column];
  const double sign = side == GROUSER_LEFT ? 1.0 : -1.0;
  const double cell_area = block->element_length * block->track_width / (block->along * block->across);
  const double soft_square = block->soft_speed * block->soft_speed;
  const double soft_belt = sqrt(belt * belt + soft_square);
  const double direction = belt / soft_belt;
  const double lever = sign * block->tread / 2;

  double share[GROUSER_MAX_WHEELS], share_by_ax[GROUSER_MAX_WHEELS], load_by_ay;
  const double track_load = grouser_side_load(block, x[GROUSER_AY], side, &load_by_ay);
  grouser_element_shares(block, x[GROUSER_AX], share, share_by_ax);

  const double resistance = -rolling * track_load * direction;
  force[0] = resistance;
  force[1] = 0;
  force[2] = -lever * resistance;
  if (jacobian) {
    memset(jacobian, 0, sizeof(double) * GROUSER_OUTPUTS * (size_t)columns);
    const double by[3] = {-rolling * load_by_ay * direction,
                          -rolling * track_load * soft_square / (soft_belt * soft_belt * soft_belt),
                          -track_load * direction};
    const int column[3] = {GROUSER_AY, belt_column, columns - 2};
    for (int n = 0; n < 3; n++) {
      jacobian[column[n]] += by[n];
      jacobian[2 * columns + column[n]] -= lever * by[n];
    }
  }

  const double tangent = grouser_friction_tangent(block, terrain);
  grouser_element_sums sums[GROUSER_MAX_WHEELS];
  integrate_track(block, x, belt, sign, jacobian ? GROUSER_ALL_SLOPES_WANTED : GROUSER_FORCES_WANTED, sums);
  for (int i = 0; i < block->wheels; i++) {
    const double load = track_load * share[i];
    const grouser_strength s = grouser_shear_strength(block, terrain, tangent, load);
    const double scale = s.stress * cell_area;
    for (int n = 0; n < GROUSER_OUTPUTS; n++) force[n] += scale * sums[i].force[n];
    if (!jacobian) continue;
    for (int n = 0; n < GROUSER_OUTPUTS; n++) {
      double *slope = jacobian + n * columns;
      const double unit = sums[i].force[n] * cell_area;
      slope[GROUSER_VX] += scale * sums[i].slope[GROUSER_BY_VX][n];
      slope[GROUSER_VY] += scale * sums[i].slope[GROUSER_BY_VY][n];
      slope[GROUSER_YAW_RATE] += scale * sums[i].slope[GROUSER_BY_YAW_RATE][n];
      slope[belt_column] += scale * sums[i].slope[GROUSER_BY_BELT][n];
      slope[columns - 1] += scale * sums[i].slope[GROUSER_BY_MODULUS][n];
      slope[GROUSER_AX] += unit * s.by_load * track_load * share_by_ax[i];
      slope[GROUSER_AY] += unit * s.by_load * load_by_ay * share[i];
      for (int p = 0; p < strength_columns; p++) slope[GROUSER_TERRAIN + p] += unit * s.by_parameter[p];
    }
  }
}

void grouser_physics_forces(const grouser_physics *block, const double *x, double force[GROUSER_OUTPUTS],
                            double *jacobian) {
  const int entries = GROUSER_OUTPUTS * grouser_columns(block->mode);
  double right[GROUSER_OUTPUTS], right_jacobian[GROUSER_OUTPUTS * GROUSER_MAX_COLUMNS];
  grouser_physics_track(block, x, GROUSER_LEFT, force, jacobian);
  grouser_physics_track(block, x, GROUSER_RIGHT, right, jacobian ? right_jacobian : NULL);
  for (int n = 0; n < GROUSER_OUTPUTS; n++) force[n] += right[n];
  if (jacobian)
    for (int n = 0; n < entries; n++) jacobian[n] += right_jacobian[n];
}

/* Adds one track of one vehicle, with what Newton asks for: the slopes by the body's motion. */
static void add_body(const grouser_physics *block, const double *x, enum grouser_side side, enum grouser_wanted wanted,
                     double force[GROUSER_OUTPUTS], double slope[GROUSER_OUTPUTS][3]) {
  const int columns = grouser_columns(block->mode);
  const double sign = side == GROUSER_LEFT ? 1.0 : -1.0, belt = x[side == GROUSER_LEFT ? GROUSER_V_LEFT : GROUSER_V_RIGHT];
  const double cell_area = block->element_length * block->track_width / (block->along * block->across);
  const double direction = belt / sqrt(belt * belt + block->soft_speed * block->soft_speed);
  const double tangent = grouser_friction_tangent(block, x + GROUSER_TERRAIN);
  double share[GROUSER_MAX_WHEELS], share_by_ax[GROUSER_MAX_WHEELS], load_by_ay, own[GROUSER_OUTPUTS];
  grouser_element_sums sums[GROUSER_MAX_WHEELS];
  const double track_load = grouser_side_load(block, x[GROUSER_AY], side, &load_by_ay);
  grouser_element_shares(block, x[GROUSER_AX], share, share_by_ax);
  integrate_track(block, x, belt, sign, wanted, sums);
  own[0] = -x[columns - 2] * track_load * direction;
  own[1] = 0;
  own[2] = -(sign * block->tread / 2) * own[0];
  for (int i = 0; i < block->wheels; i++) {
    const grouser_strength s = grouser_shear_strength(block, x + GROUSER_TERRAIN, tangent, track_load * share[i]);
    const double scale = s.stress * cell_area;
    for (int n = 0; n < GROUSER_OUTPUTS; n++) {
      own[n] += scale * sums[i].force[n];
      for (int d = 0; wanted != GROUSER_FORCES_WANTED && d < 3; d++) slope[n][d] += scale * sums[i].slope[d][n];
    }
  }
  for (int n = 0; n < GROUSER_OUTPUTS; n++) force[n] += own[n];
}

void grouser_physics_body(const grouser_physics *block, const double *left, const double *right,
                          double force[GROUSER_OUTPUTS], double slope[GROUSER_OUTPUTS][3]) {
  const enum grouser_wanted wanted = slope ? GROUSER_BODY_SLOPES_WANTED : GROUSER_FORCES_WANTED;
  for (int n = 0; n < GROUSER_OUTPUTS; n++) force[n] = 0;
  if (slope) memset(slope, 0, sizeof(double) * GROUSER_OUTPUTS * 3);
  add_body(block, left, GROUSER_LEFT, wanted, force, slope);
  add_body(block, right ? right : left, GROUSER_RIGHT, wanted, force, slope);
}

const char *grouser_physics_refuses(const grouser_physics *block, const double *x) {
  const char *const *names = block->mode == GROUSER_RIGID ? RIGID_COLUMNS : SOIL_COLUMNS;
  const int columns = grouser_columns(block->mode);
  for (int n = 0; n < columns; n++)
    if (!isfinite(x[n])) return names[n];
  if (!(x[columns - 1] > 0)) return names[columns - 1];
  if (block->soft_speed == 0) {
    if (x[GROUSER_V_LEFT] == 0) return names[GROUSER_V_LEFT];
    if (x[GROUSER_V_RIGHT] == 0) return names[GROUSER_V_RIGHT];
  }
  return NULL;
}
