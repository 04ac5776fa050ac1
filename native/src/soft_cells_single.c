#include <math.h>
#include <string.h>

#include "cells.h"
#include "exponential.h"
#include "lanes.h"

/* The soft path in float32, for speed. Slip and moments are taken about the element's centre, where the large parts of
 * both, common to all cells, are left to float64; what float32 rounds is then of the size of the cells' own share. */

enum { SINGLE_LANES = 16 };

static float lanes_total(const float lane[SINGLE_LANES]) {
  float part[4];
  for (int l = 0; l < 4; l++) part[l] = (lane[l] + lane[l + 8]) + (lane[l + 4] + lane[l + 12]);
  return (part[0] + part[2]) + (part[1] + part[3]);
}

void grouser_fill_single_strip(const grouser_physics *block, int first, grouser_single_strip *strip) {
  const int along = block->along, across = block->across, cells = along * across;
  const double length = block->element_length, width = block->track_width;
  const int count = cells - first < GROUSER_SINGLE_STRIP ? cells - first : GROUSER_SINGLE_STRIP;
  const int lanes = (count + SINGLE_LANES - 1) / SINGLE_LANES * SINGLE_LANES;
  const double step = length / along, side_step = width / across;
  int i = first / across, j = first % across;
  for (int n = 0; n < lanes; n++) {
    strip->offset[n] = (float)((i + 0.5) * step - length / 2);
    strip->aside[n] = (float)((j + 0.5) * side_step - width / 2);
    strip->weight[n] = n < count ? 1.0f : 0.0f;
    if (n + 1 < count && ++j == across) {
      j = 0;
      i++;
    }
  }
  strip->lanes = lanes;
}

GROUSER_INLINE void add_element(const grouser_element_motion *m, const grouser_single_strip *strip, double lever,
                                const int want_slopes, const int all, grouser_element_sums *sums) {
  const float along = (float)(m->vx - m->yaw_rate * lever - m->belt);
  const float across = (float)(m->vy + m->yaw_rate * m->center), yaw_rate = (float)m->yaw_rate;
  const double per_meter = 1.0 / (m->soft_belt * m->modulus);
  const float base = (float)((m->half_travel - m->direction * m->reach) * per_meter);
  const float fall = (float)(m->direction * per_meter);
  const float travelled = (float)(m->half_travel - m->direction * m->reach), direction = (float)m->direction;
  const float direction_slope = (float)m->direction_slope, reach = (float)m->reach;
  const float per_belt = (float)(m->direction / m->soft_belt), per_modulus = (float)(1.0 / m->modulus);
  float fx_lane[SINGLE_LANES] = {0}, fy_lane[SINGLE_LANES] = {0}, m_lane[SINGLE_LANES] = {0};
  float lane[GROUSER_SLOPES][GROUSER_OUTPUTS][SINGLE_LANES];
  if (want_slopes) memset(lane, 0, sizeof lane);
  for (int first = 0; first < strip->lanes; first += SINGLE_LANES) {
    for (int l = 0; l < SINGLE_LANES; l++) {
      const float x = strip->offset[first + l], y = strip->aside[first + l];
      const float stretch = strip->weight[first + l] * (base - fall * x);
      const float ux = stretch * (along - yaw_rate * y), uy = stretch * (across + yaw_rate * x);
      const float z = sqrtf(ux * ux + uy * uy);
      const float factor = z > 0 ? expm1_negative_single(z) / (z > 0 ? z : 1.0f) : -1.0f;
      fx_lane[l] += factor * ux;
      fy_lane[l] += factor * uy;
      m_lane[l] += factor * (x * uy - y * ux);
    }
    if (!want_slopes) continue;
    for (int l = 0; l < SINGLE_LANES; l++) {
      const float x = strip->offset[first + l], y = strip->aside[first + l];
      const float stretch = strip->weight[first + l] * (base - fall * x);
      const float stretch_slope = -direction_slope * (x + reach) / (travelled - direction * x) - per_belt;
      const float ux = stretch * (along - yaw_rate * y), uy = stretch * (across + yaw_rate * x);
      const float z = sqrtf(ux * ux + uy * uy), safe = z > 0 ? z : 1.0f, rise = expm1_negative_single(z);
      const float factor = z > 0 ? -rise / safe : 1.0f, decay = 1.0f + rise, bend = decay - factor;
      const float nx = ux / safe, ny = uy / safe;
      const float gxx = stretch * (factor + bend * nx * nx), gxy = stretch * bend * nx * ny;
      const float gyy = stretch * (factor + bend * ny * ny);
      const float wx = gxy * x - gxx * y, wy = gyy * x - gxy * y;
      const float along_x = decay * ux, along_y = decay * uy;
      const float bx = gxx - stretch_slope * along_x, by = gxy - stretch_slope * along_y;
      lane[GROUSER_BY_VX][0][l] -= gxx;
      lane[GROUSER_BY_VX][1][l] -= gxy;
      lane[GROUSER_BY_VX][2][l] -= x * gxy - y * gxx;
      lane[GROUSER_BY_VY][1][l] -= gyy;
      lane[GROUSER_BY_VY][2][l] -= x * gyy - y * gxy;
      lane[GROUSER_BY_YAW_RATE][2][l] -= x * wy - y * wx;
      if (!all) continue;
      lane[GROUSER_BY_BELT][0][l] += bx;
      lane[GROUSER_BY_BELT][1][l] += by;
      lane[GROUSER_BY_BELT][2][l] += x * by - y * bx;
      lane[GROUSER_BY_MODULUS][0][l] += along_x * per_modulus;
      lane[GROUSER_BY_MODULUS][1][l] += along_y * per_modulus;
      lane[GROUSER_BY_MODULUS][2][l] += (x * along_y - y * along_x) * per_modulus;
    }
  }
  const double center = m->center;
  const double fx = (double)lanes_total(fx_lane), fy = (double)lanes_total(fy_lane);
  sums->force[0] += fx;
  sums->force[1] += fy;
  sums->force[2] += (double)lanes_total(m_lane) + center * fy - lever * fx;
  if (!want_slopes) return;
  double slope[GROUSER_SLOPES][GROUSER_OUTPUTS];
  const int slopes = all ? GROUSER_SLOPES : GROUSER_BODY_SLOPES;
  for (int s = 0; s < slopes; s++)
    for (int n = 0; n < GROUSER_OUTPUTS; n++) slope[s][n] = (double)lanes_total(lane[s][n]);
  slope[GROUSER_BY_VY][0] = slope[GROUSER_BY_VX][1];
  /* The matrix is symmetric about the element's centre, and turning there is what the moment is of. */
  slope[GROUSER_BY_YAW_RATE][0] = slope[GROUSER_BY_VX][2];
  slope[GROUSER_BY_YAW_RATE][1] = slope[GROUSER_BY_VY][2];
  for (int n = 0; n < GROUSER_OUTPUTS; n++)
    slope[GROUSER_BY_YAW_RATE][n] += center * slope[GROUSER_BY_VY][n] - lever * slope[GROUSER_BY_VX][n];
  for (int s = 0; s < slopes; s++) {
    slope[s][2] += center * slope[s][1] - lever * slope[s][0];
    for (int n = 0; n < GROUSER_OUTPUTS; n++) sums->slope[s][n] += slope[s][n];
  }
}

void grouser_single_cells(const grouser_element_motion *m, const grouser_single_strip *strip, double lever,
                          enum grouser_wanted wanted, grouser_element_sums *sums) {
  if (wanted == GROUSER_ALL_SLOPES_WANTED)
    add_element(m, strip, lever, 1, 1, sums);
  else if (wanted == GROUSER_BODY_SLOPES_WANTED)
    add_element(m, strip, lever, 1, 0, sums);
  else
    add_element(m, strip, lever, 0, 0, sums);
}
