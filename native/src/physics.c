#include "grouser/physics.h"

#include <math.h>
#include <string.h>

#include "cells.h"
#include "place.h"

static const char *const RIGID_COLUMNS[] = {GROUSER_RIGID_COLUMNS};
static const char *const SOIL_COLUMNS[] = {GROUSER_SOIL_COLUMNS};

static const enum grouser_side BOTH_SIDES[] = {GROUSER_LEFT, GROUSER_RIGHT};

/* Sums over the cells of a track: see grouser_patch_sums. */
typedef struct {
  double force[GROUSER_OUTPUTS];
  double slope[GROUSER_SLOPES][GROUSER_OUTPUTS];
  double weighted[GROUSER_WEIGHTED][GROUSER_OUTPUTS];
} track_sums;

static double lane_total(const double lane[GROUSER_STATIONS]) {
  return ((lane[0] + lane[4]) + (lane[2] + lane[6])) + ((lane[1] + lane[5]) + (lane[3] + lane[7]));
}

static void add_patch(const grouser_physics *block, enum grouser_wanted wanted, const grouser_patch_sums *sums,
                      track_sums *to) {
  const int slopes = wanted == GROUSER_FORCES_WANTED        ? 0
                     : wanted == GROUSER_BODY_SLOPES_WANTED ? GROUSER_BODY_SLOPES
                                                            : GROUSER_SLOPES;
  const int weights = wanted != GROUSER_ALL_SLOPES_WANTED ? 0
                      : block->mode == GROUSER_RIGID      ? GROUSER_RIGID_WEIGHTED
                                                          : GROUSER_WEIGHTED;
  const int symmetric = block->path == GROUSER_SOFT_PATH;
  for (int n = 0; n < GROUSER_OUTPUTS; n++) {
    to->force[n] += lane_total(sums->force[n]);
    for (int by = 0; by < slopes; by++)
      if (!grouser_mirrored(symmetric, by, n)) to->slope[by][n] += lane_total(sums->slope[by][n]);
    for (int w = 0; w < weights; w++) to->weighted[w][n] += lane_total(sums->weighted[w][n]);
  }
}

static void add_cells(const grouser_physics *block, const grouser_layout *layout, const grouser_track *tracks,
                      int count, enum grouser_wanted wanted, track_sums *sums) {
  grouser_stations at[GROUSER_RUN];
  grouser_strip strips[2];
  grouser_patch_sums own[2];
  grouser_patch patch = {count, 0, tracks, strips, at};
  memset(sums, 0, sizeof *sums * (size_t)count);
  for (int first = 0; first < layout->count; first += GROUSER_RUN * GROUSER_STATIONS) {
    patch.count = grouser_place_run(layout, tracks, count, first, wanted == GROUSER_ALL_SLOPES_WANTED, at);
    for (int column = 0; column < block->across; column += GROUSER_STRIP) {
      for (int n = 0; n < count; n++) grouser_fill_strip(block, &tracks[n], column, &strips[n]);
      if (block->path == GROUSER_EXACT_PATH)
        grouser_exact_cells(&patch, wanted, own);
      else if (block->precision == GROUSER_SINGLE)
        grouser_single_cells(&patch, wanted, own);
      else
        grouser_soft_cells(&patch, wanted, own);
      for (int n = 0; n < count; n++) add_patch(block, wanted, &own[n], &sums[n]);
    }
  }
}

static void force_of_track(const grouser_physics *block, const double *x, enum grouser_side side,
                           const grouser_track *t, const track_sums *sums, double force[GROUSER_OUTPUTS]) {
  const double sign = grouser_side_sign(side), lever = block->tread / 2;
  const double rolling = -x[grouser_columns(block->mode) - 2] * t->load * t->direction;
  const double along = rolling - sums->force[0];
  force[0] = along;
  force[1] = -sign * sums->force[1];
  force[2] = -sign * (sums->force[2] + lever * along);
}

/* A derivative of [Fx, Fy, M] of a track, from that of the force against the slip about the track's middle. */
static void to_vehicle(double sign, double lever, double scale, const double against[GROUSER_OUTPUTS],
                       double out[GROUSER_OUTPUTS]) {
  out[0] = -scale * against[0];
  out[1] = -scale * sign * against[1];
  out[2] = -scale * sign * (against[2] - lever * against[0]);
}

/* Slopes of a track's force by the vehicle's vx, vy, yaw rate and, if all are wanted, by its belt speed and K. */
static void slopes_of_track(const grouser_physics *block, enum grouser_side side, const track_sums *sums, int slopes,
                            double out[GROUSER_SLOPES][GROUSER_OUTPUTS]) {
  const double sign = grouser_side_sign(side), lever = block->tread / 2;
  double total[GROUSER_SLOPES][GROUSER_OUTPUTS];
  for (int s = 0; s < slopes; s++)
    for (int n = 0; n < GROUSER_OUTPUTS; n++) total[s][n] = sums->slope[s][n];
  if (block->path == GROUSER_SOFT_PATH) {
    /* Where the force hangs on the slip alone, its matrix is symmetric. */
    total[GROUSER_BY_VY][0] = total[GROUSER_BY_VX][1];
    total[GROUSER_BY_YAW_RATE][0] = total[GROUSER_BY_VX][2];
    total[GROUSER_BY_YAW_RATE][1] = total[GROUSER_BY_VY][2];
  }
  for (int n = 0; n < GROUSER_OUTPUTS; n++) {
    total[GROUSER_BY_YAW_RATE][n] -= lever * total[GROUSER_BY_VX][n];
    if (slopes > GROUSER_BY_BELT) total[GROUSER_BY_BELT][n] -= total[GROUSER_BY_VX][n];
  }
  for (int s = 0; s < slopes; s++) {
    const int mirrored = s == GROUSER_BY_VY || s == GROUSER_BY_YAW_RATE;
    to_vehicle(sign, lever, mirrored ? sign : 1.0, total[s], out[s]);
  }
}

/* Adds one track's share of the jacobian. */
static void add_jacobian(const grouser_physics *block, const double *x, enum grouser_side side, const grouser_track *t,
                         const track_sums *sums, double *jacobian) {
  const int columns = grouser_columns(block->mode), belt = side == GROUSER_LEFT ? GROUSER_V_LEFT : GROUSER_V_RIGHT;
  const double sign = grouser_side_sign(side), lever = block->tread / 2, rolling = x[columns - 2];
  const double cells = (double)block->along * block->across;
  double slope[GROUSER_SLOPES][GROUSER_OUTPUTS], weighted[GROUSER_WEIGHTED][GROUSER_OUTPUTS] = {{0}};
  slopes_of_track(block, side, sums, GROUSER_SLOPES, slope);
  for (int w = 0; w < GROUSER_WEIGHTED; w++) to_vehicle(sign, lever, 1.0, sums->weighted[w], weighted[w]);
  const double fade = t->cohesion * t->per_full_contact, tangent = t->friction * cells;
  const double resistance[GROUSER_OUTPUTS] = {-t->direction, 0, sign * lever * t->direction};
  for (int n = 0; n < GROUSER_OUTPUTS; n++) {
    double *row = jacobian + n * columns;
    const double by_share = t->friction * weighted[GROUSER_OF_SHARE][n] + fade * weighted[GROUSER_OF_FADING_SHARE][n];
    const double by_share_slope =
        t->friction * weighted[GROUSER_OF_SHARE_SLOPE][n] + fade * weighted[GROUSER_OF_FADING_SHARE_SLOPE][n];
    const double by_tangent = t->load / cells * weighted[GROUSER_OF_SHARE][n];
    row[GROUSER_VX] += slope[GROUSER_BY_VX][n];
    row[GROUSER_VY] += slope[GROUSER_BY_VY][n];
    row[GROUSER_YAW_RATE] += slope[GROUSER_BY_YAW_RATE][n];
    row[GROUSER_AX] += t->load * by_share_slope;
    row[GROUSER_AY] += t->load_by_ay * (by_share + rolling * resistance[n]);
    row[belt] += slope[GROUSER_BY_BELT][n];
    row[columns - 1] += slope[GROUSER_BY_MODULUS][n];
    row[columns - 2] += t->load * resistance[n];
    if (t->cohesive) {
      row[GROUSER_TERRAIN] += block->element_length * block->track_width / cells * weighted[GROUSER_OF_COHESION][n];
      row[GROUSER_TERRAIN + 1] += (1 + tangent * tangent) * by_tangent;
    } else {
      row[GROUSER_TERRAIN] += by_tangent;
    }
  }
  jacobian[belt] -= rolling * t->load * t->direction_slope;
  jacobian[2 * columns + belt] += sign * lever * rolling * t->load * t->direction_slope;
}

void grouser_physics_track(const grouser_physics *block, const double *x, enum grouser_side side,
                           double force[GROUSER_OUTPUTS], double *jacobian) {
  grouser_layout layout;
  grouser_lay_out(block, &layout);
  grouser_track track[2];
  track_sums sums[2];
  const int tracks = block->precision == GROUSER_SINGLE ? 2 : 1; /* whose vectors hold two */
  for (int n = 0; n < tracks; n++) grouser_find_track(block, &layout, x, side, &track[n]);
  add_cells(block, &layout, track, tracks, jacobian ? GROUSER_ALL_SLOPES_WANTED : GROUSER_FORCES_WANTED, sums);
  force_of_track(block, x, side, track, sums, force);
  if (!jacobian) return;
  memset(jacobian, 0, sizeof(double) * GROUSER_OUTPUTS * (size_t)grouser_columns(block->mode));
  add_jacobian(block, x, side, track, sums, jacobian);
}

/* Sums of both tracks, each by its own row, and their force together. */
static void both_tracks(const grouser_physics *block, const double *const row[2], enum grouser_wanted wanted,
                        grouser_track track[2], track_sums sums[2], double force[GROUSER_OUTPUTS]) {
  grouser_layout layout;
  grouser_lay_out(block, &layout);
  double right[GROUSER_OUTPUTS];
  for (int n = 0; n < 2; n++) grouser_find_track(block, &layout, row[n], BOTH_SIDES[n], &track[n]);
  add_cells(block, &layout, track, 2, wanted, sums);
  force_of_track(block, row[0], GROUSER_LEFT, &track[0], &sums[0], force);
  force_of_track(block, row[1], GROUSER_RIGHT, &track[1], &sums[1], right);
  for (int n = 0; n < GROUSER_OUTPUTS; n++) force[n] += right[n];
}

void grouser_physics_forces(const grouser_physics *block, const double *x, double force[GROUSER_OUTPUTS],
                            double *jacobian) {
  const double *const row[2] = {x, x};
  grouser_track track[2];
  track_sums sums[2];
  both_tracks(block, row, jacobian ? GROUSER_ALL_SLOPES_WANTED : GROUSER_FORCES_WANTED, track, sums, force);
  if (!jacobian) return;
  memset(jacobian, 0, sizeof(double) * GROUSER_OUTPUTS * (size_t)grouser_columns(block->mode));
  for (int n = 0; n < 2; n++) add_jacobian(block, x, BOTH_SIDES[n], &track[n], &sums[n], jacobian);
}

void grouser_physics_body(const grouser_physics *block, const double *left, const double *right,
                          double force[GROUSER_OUTPUTS], double slope[GROUSER_OUTPUTS][3]) {
  const double *const row[2] = {left, right ? right : left};
  grouser_track track[2];
  track_sums sums[2];
  both_tracks(block, row, slope ? GROUSER_BODY_SLOPES_WANTED : GROUSER_FORCES_WANTED, track, sums, force);
  if (!slope) return;
  double by_track[2][GROUSER_SLOPES][GROUSER_OUTPUTS];
  for (int n = 0; n < 2; n++) slopes_of_track(block, BOTH_SIDES[n], &sums[n], GROUSER_BODY_SLOPES, by_track[n]);
  for (int n = 0; n < GROUSER_OUTPUTS; n++)
    for (int s = 0; s < GROUSER_BODY_SLOPES; s++) slope[n][s] = by_track[0][s][n] + by_track[1][s][n];
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
