#include <math.h>

#include "cell_sums.h"
#include "cells.h"
#include "exponential.h"

static const double PI = 3.14159265358979323846;
/* Squares of a speed or a displacement below which there is none. */
static const double EXACT_TINY = 1e-300;
/* Square of the angle below which the slopes of S and C are their first terms. */
static const double STRAIGHT = 1e-10;

/* sin(h)/h and cos(h) by the square of |h| <= pi/2; the Taylor sums end below 1e-16. */
GROUSER_INLINE grouser_doubles sine_over_angle(grouser_doubles square) {
  grouser_doubles p = doubles_of(1.0 / 51090942171709440000.0);
  p = p * square - doubles_of(1.0 / 121645100408832000.0);
  p = p * square + doubles_of(1.0 / 355687428096000.0);
  p = p * square - doubles_of(1.0 / 1307674368000.0);
  p = p * square + doubles_of(1.0 / 6227020800.0);
  p = p * square - doubles_of(1.0 / 39916800.0);
  p = p * square + doubles_of(1.0 / 362880.0);
  p = p * square - doubles_of(1.0 / 5040.0);
  p = p * square + doubles_of(1.0 / 120.0);
  p = p * square - doubles_of(1.0 / 6.0);
  return p * square + doubles_of(1.0);
}

GROUSER_INLINE grouser_doubles cosine_of(grouser_doubles square) {
  grouser_doubles p = doubles_of(1.0 / 2432902008176640000.0);
  p = p * square - doubles_of(1.0 / 6402373705728000.0);
  p = p * square + doubles_of(1.0 / 20922789888000.0);
  p = p * square - doubles_of(1.0 / 87178291200.0);
  p = p * square + doubles_of(1.0 / 479001600.0);
  p = p * square - doubles_of(1.0 / 3628800.0);
  p = p * square + doubles_of(1.0 / 40320.0);
  p = p * square - doubles_of(1.0 / 720.0);
  p = p * square + doubles_of(1.0 / 24.0);
  p = p * square - doubles_of(0.5);
  return p * square + doubles_of(1.0);
}

/* A shear displacement, or a slope of it, at a row of cells: (a_x a + x, a_y a + y) by their slip a along. */
typedef struct {
  grouser_doubles a_x, x, a_y, y;
} row_path;

/* The vehicle's velocity, turned back through theta = omega t and integrated over the contact time t, moves a point by
 * t [[S, C], [-C, S]] v, S = sin(theta)/theta, C = (1 - cos(theta))/theta. */
typedef struct {
  grouser_doubles across, time;
  row_path path, by_yaw_rate, by_belt;
} station_paths;

GROUSER_INLINE station_paths paths_at(const grouser_track *track, const grouser_stations *at, int from,
                                      const int slopes) {
  const grouser_doubles none = doubles_of(0.0), one = doubles_of(1.0), half = doubles_of(0.5);
  const grouser_doubles yaw_rate = doubles_of(track->yaw_rate), belt = doubles_of(track->belt);
  /* A chord shrinks again beyond half a turn, the shear does not: the path counts back to half a turn at most. */
  const grouser_doubles half_turn = doubles_of(PI / fabs(track->yaw_rate)), modulus = doubles_of(track->modulus);
  const grouser_doubles whole = doubles_load(&at->stretch[from]) * modulus, t = doubles_least(whole, half_turn);
  const grouser_doubles theta = yaw_rate * t, angle = half * theta, square = angle * angle;
  const grouser_doubles over = sine_over_angle(square), half_sine = angle * over, half_cosine = cosine_of(square);
  const grouser_doubles sine = (half_sine + half_sine) * half_cosine;
  const grouser_doubles cosine = one - (half_sine + half_sine) * half_sine;
  const grouser_doubles s = over * half_cosine, c = over * half_sine;
  const grouser_doubles b = doubles_load(&at->across[from]), belt_x = s - cosine, belt_y = sine - c;
  station_paths p;
  p.across = b;
  p.time = t;
  p.path.a_x = t * s;
  p.path.a_y = none - t * c;
  p.path.x = t * (c * b + belt * belt_x);
  p.path.y = t * (s * b + belt * belt_y);
  if (!slopes) return p;
  const grouser_doubles straight = doubles_of(STRAIGHT), turned = theta * theta;
  const grouser_doubles per_theta = one / doubles_where_less(straight, turned, theta, one);
  const grouser_doubles s_slope =
      doubles_where_less(straight, turned, (cosine - s) * per_theta, theta * doubles_of(-1.0 / 3));
  const grouser_doubles c_slope = doubles_where_less(straight, turned, (sine - c) * per_theta, half);
  /* The path by its length in time, which the belt speed changes, and past half a turn the yaw rate. */
  const grouser_doubles ahead = b + belt * theta, by_time_x = sine * ahead, by_time_y = cosine * ahead;
  const grouser_doubles time_by_yaw_rate =
      doubles_where_less(half_turn, whole, t * doubles_of(-1.0 / (track->yaw_rate != 0 ? track->yaw_rate : 1.0)), none);
  const grouser_doubles t_square = t * t;
  p.by_yaw_rate.a_x = t_square * s_slope + cosine * time_by_yaw_rate;
  p.by_yaw_rate.a_y = none - (t_square * c_slope + sine * time_by_yaw_rate);
  p.by_yaw_rate.x = t_square * (c_slope * b + belt * (s_slope + sine)) + by_time_x * time_by_yaw_rate;
  p.by_yaw_rate.y = t_square * (s_slope * b + belt * (cosine - c_slope)) + by_time_y * time_by_yaw_rate;
  if (slopes == GROUSER_BODY_SLOPES) return p;
  const grouser_doubles time_by_belt =
      doubles_where_less(half_turn, whole, none, doubles_load(&at->stretch_by_belt[from]) * modulus);
  p.by_belt.a_x = cosine * time_by_belt;
  p.by_belt.a_y = none - sine * time_by_belt;
  p.by_belt.x = t * belt_x + by_time_x * time_by_belt;
  p.by_belt.y = t * belt_y + by_time_y * time_by_belt;
  return p;
}

/* With z = |j|/K: h = (1 - exp(-z))/|v|, q = -h/v^2. What changes j by dj adds g v to the slope,
 * g = exp(-z) (j'dj)/(|v| |j| K). */
typedef struct {
  grouser_row row;
  grouser_doubles g[GROUSER_SLOPES], g_slip[GROUSER_SLOPES], g_slip_moment[GROUSER_SLOPES];
} exact_row;

/* The displacement of a column's cells, its length and square, and size and square of their slip velocity. */
typedef struct {
  grouser_doubles path_x, path_y, length_square, length, size_square, size;
} exact_cell;

GROUSER_INLINE exact_cell exact_cell_at(const grouser_strip *strip, const station_paths *at, int j) {
  const grouser_doubles slip = doubles_of(strip->slip[j]);
  exact_cell c;
  c.path_x = at->path.a_x * slip + at->path.x;
  c.path_y = at->path.a_y * slip + at->path.y;
  c.length_square = c.path_x * c.path_x + c.path_y * c.path_y;
  c.length = doubles_root(c.length_square);
  c.size_square = doubles_of(strip->slip_square[j]) + at->across * at->across;
  c.size = doubles_root(c.size_square);
  return c;
}

GROUSER_INLINE exact_row sum_exact_row(const grouser_strip *strip, const station_paths *at, grouser_doubles x,
                                       grouser_doubles per_modulus, const int slopes) {
  const grouser_doubles none = doubles_of(0.0), one = doubles_of(1.0), tiny = doubles_of(EXACT_TINY);
  const grouser_doubles sticking = at->time * per_modulus, halvings = per_modulus * doubles_of(GROUSER_LOG2E);
  exact_row sum;
  const grouser_row empty = {none, none, none, none, none, none, none, none, none};
  grouser_row *row = &sum.row;
  sum.row = empty;
  for (int by = 0; by < slopes; by++) sum.g[by] = sum.g_slip[by] = sum.g_slip_moment[by] = none;
  /* The next roots are begun before the sum of these, behind which they would wait. */
  exact_cell next = exact_cell_at(strip, at, 0);
  for (int j = 0; j < strip->count; j++) {
    const exact_cell cell = next;
    if (j + 1 < strip->count) next = exact_cell_at(strip, at, j + 1);
    const grouser_doubles slip = doubles_of(strip->slip[j]), slip_square = doubles_of(strip->slip_square[j]);
    const grouser_doubles slip_moment = doubles_of(strip->slip_moment[j]);
    const grouser_doubles per_size = doubles_where_less(tiny, cell.size_square, one / cell.size, none);
    const grouser_doubles saturation = doubles_saturation(cell.length * halvings);
    /* Where neither sliding nor displacement is left, the force is (t/K) v. */
    const grouser_doubles resting = doubles_where_less(tiny, cell.length_square, none, sticking);
    const grouser_doubles h = doubles_where_less(tiny, cell.size_square, saturation * per_size, resting);
    row->h += h;
    row->h_slip += h * slip;
    row->h_slip_moment += h * slip_moment;
    if (!slopes) continue;
    const grouser_doubles arm = doubles_of(strip->arm[j]);
    const grouser_doubles q = (none - h) * (per_size * per_size), p = h + q * slip_square;
    row->p += p;
    row->p_arm += p * arm;
    row->p_arm_square += p * doubles_of(strip->arm_square[j]);
    row->q += q;
    row->q_slip += q * slip;
    row->q_slip_moment += q * slip_moment;
    const grouser_doubles per_length = doubles_where_less(tiny, cell.length_square, one / cell.length, none);
    const grouser_doubles gain = (one - saturation) * per_size * per_length * per_modulus;
    const grouser_doubles gain_x = gain * cell.path_x, gain_y = gain * cell.path_y;
    const row_path *yaw = &at->by_yaw_rate, *belt = &at->by_belt;
    grouser_doubles g[GROUSER_SLOPES];
    g[GROUSER_BY_VX] = gain_x * at->path.a_x + gain_y * at->path.a_y;
    g[GROUSER_BY_VY] = gain_y * at->path.a_x - gain_x * at->path.a_y;
    g[GROUSER_BY_YAW_RATE] = gain_x * (yaw->a_x * slip + yaw->x) + gain_y * (yaw->a_y * slip + yaw->y) +
                             x * g[GROUSER_BY_VY] - arm * g[GROUSER_BY_VX];
    if (slopes > GROUSER_BODY_SLOPES) {
      g[GROUSER_BY_BELT] = gain_x * (belt->a_x * slip + belt->x) + gain_y * (belt->a_y * slip + belt->y);
      g[GROUSER_BY_MODULUS] = (none - gain) * cell.length_square * per_modulus;
    }
    for (int by = 0; by < slopes; by++) {
      sum.g[by] += g[by];
      sum.g_slip[by] += g[by] * slip;
      sum.g_slip_moment[by] += g[by] * slip_moment;
    }
  }
  return sum;
}

GROUSER_INLINE void add_exact_stations(const grouser_track *track, const grouser_strip *strip,
                                       const grouser_stations *at, int from, const int slopes, const int weights,
                                       grouser_sums *sums) {
  const grouser_doubles x = doubles_load(&at->x[from]), strength = doubles_load(&at->strength[from]);
  const station_paths paths = paths_at(track, at, from, slopes);
  const grouser_doubles across = paths.across;
  const exact_row sum = sum_exact_row(strip, &paths, x, doubles_of(1.0 / track->modulus), slopes);
  grouser_doubles unit[GROUSER_OUTPUTS];
  grouser_unit_force(&sum.row, x, across, unit);
  for (int n = 0; n < GROUSER_OUTPUTS; n++) sums->force[n] += strength * unit[n];
  if (!slopes) return;
  const grouser_matrix m = grouser_matrix_of(&sum.row, x, across);
  const grouser_doubles by_velocity[GROUSER_BODY_SLOPES][GROUSER_OUTPUTS] = {
      {m.xx, m.xy, m.xm}, {m.xy, m.yy, m.ym}, {m.xm, m.ym, m.mm}};
  for (int by = 0; by < slopes; by++) {
    const grouser_doubles g_y = across * sum.g[by];
    const grouser_doubles by_path[GROUSER_OUTPUTS] = {sum.g_slip[by], g_y, x * g_y - sum.g_slip_moment[by]};
    for (int n = 0; n < GROUSER_OUTPUTS; n++)
      sums->slope[by][n] += strength * (by < GROUSER_BODY_SLOPES ? by_velocity[by][n] + by_path[n] : by_path[n]);
  }
  if (weights) grouser_add_weighted(track, at, from, unit, weights, sums);
}

GROUSER_INLINE void sum_exact_patch(const grouser_patch *patch, const int slopes, const int weights,
                                    grouser_patch_sums *sums) {
  for (int n = 0; n < patch->tracks; n++)
    for (int lane = 0; lane < GROUSER_STATIONS; lane += GROUSER_DOUBLES) {
      grouser_sums own;
      grouser_clear(slopes, weights, &own);
      for (int i = 0; i < patch->count; i++)
        add_exact_stations(&patch->track[n], &patch->strip[n], &patch->at[i], n * GROUSER_STATIONS + lane, slopes,
                           weights, &own);
      grouser_store(&own, slopes, weights, 0, lane, &sums[n]);
    }
}

void grouser_exact_cells(const grouser_patch *patch, enum grouser_wanted wanted, grouser_patch_sums *sums) {
  if (wanted == GROUSER_FORCES_WANTED)
    sum_exact_patch(patch, 0, 0, sums);
  else if (wanted == GROUSER_BODY_SLOPES_WANTED)
    sum_exact_patch(patch, GROUSER_BODY_SLOPES, 0, sums);
  else if (!patch->track->cohesive)
    sum_exact_patch(patch, GROUSER_SLOPES, GROUSER_RIGID_WEIGHTED, sums);
  else
    sum_exact_patch(patch, GROUSER_SLOPES, GROUSER_WEIGHTED, sums);
}
