#include <math.h>
#include <string.h>

#include "cells.h"
#include "exponential.h"
#include "lanes.h"

static double lane_total(const double lane[GROUSER_LANES]) {
  return ((lane[0] + lane[4]) + (lane[2] + lane[6])) + ((lane[1] + lane[5]) + (lane[3] + lane[7]));
}

void grouser_soft_forces(const grouser_element_motion *m, const grouser_cell_strip *strip, grouser_element_sums *sums) {
  double fx_lane[GROUSER_LANES] = {0}, fy_lane[GROUSER_LANES] = {0}, m_lane[GROUSER_LANES] = {0};
  const double gain = 1.0 / (m->soft_belt * m->modulus);
  for (int first = 0; first < strip->lanes; first += GROUSER_LANES) {
    for (int l = 0; l < GROUSER_LANES; l++) {
      const double offset = strip->offset[first + l], y = strip->y[first + l];
      const double x = m->center + offset;
      const double stretch = strip->weight[first + l] * (m->half_travel - m->direction * (offset + m->reach)) * gain;
      const double ux = stretch * (m->vx - m->yaw_rate * y - m->belt), uy = stretch * (m->vy + m->yaw_rate * x);
      const double z = sqrt(ux * ux + uy * uy);
      const double factor = z > 0 ? expm1_negative(z) / (z > 0 ? z : 1.0) : -1.0;
      const double fx = factor * ux, fy = factor * uy;
      fx_lane[l] += fx;
      fy_lane[l] += fy;
      m_lane[l] += x * fy - y * fx;
    }
  }
  sums->force[0] += lane_total(fx_lane);
  sums->force[1] += lane_total(fy_lane);
  sums->force[2] += lane_total(m_lane);
}

/* dF = -(phi1 I + (exp(-z) - phi1) n n') du, n = u/|u|; along u itself the bracket is exp(-z). The slopes by yaw rate
 * follow from those by vx and vy at the cell. */
GROUSER_INLINE void add_slopes(const grouser_element_motion *m, const grouser_cell_strip *strip, const int all,
                               grouser_element_sums *sums) {
  double lane[GROUSER_SLOPES][GROUSER_OUTPUTS][GROUSER_LANES];
  memset(lane, 0, sizeof lane);
  const double gain = 1.0 / (m->soft_belt * m->modulus);
  const double inverse_modulus = 1.0 / m->modulus;
  for (int first = 0; first < strip->lanes; first += GROUSER_LANES) {
    for (int l = 0; l < GROUSER_LANES; l++) {
      const double offset = strip->offset[first + l], y = strip->y[first + l];
      const double x = m->center + offset;
      const double travelled = m->half_travel - m->direction * (offset + m->reach);
      const double stretch = strip->weight[first + l] * travelled * gain;
      const double stretch_slope =
          -m->direction_slope * (offset + m->reach) / travelled - m->direction / m->soft_belt;
      const double ux = stretch * (m->vx - m->yaw_rate * y - m->belt), uy = stretch * (m->vy + m->yaw_rate * x);
      const double z = sqrt(ux * ux + uy * uy);
      const double safe = z > 0 ? z : 1.0;
      const double rise = expm1_negative(z);
      const double factor = z > 0 ? -rise / safe : 1.0;
      const double decay = 1.0 + rise;
      const double nx = ux / safe, ny = uy / safe, bend = decay - factor;
      const double gxx = stretch * (factor + bend * nx * nx);
      const double gxy = stretch * bend * nx * ny;
      const double gyy = stretch * (factor + bend * ny * ny);
      const double wx = gxy * x - gxx * y, wy = gyy * x - gxy * y;
      const double along_x = decay * ux, along_y = decay * uy;
      const double bx = gxx - stretch_slope * along_x, by = gxy - stretch_slope * along_y;
      const double kx = along_x * inverse_modulus, ky = along_y * inverse_modulus;
      lane[GROUSER_BY_VX][0][l] -= gxx;
      lane[GROUSER_BY_VX][1][l] -= gxy;
      lane[GROUSER_BY_VX][2][l] -= x * gxy - y * gxx;
      lane[GROUSER_BY_VY][1][l] -= gyy;
      lane[GROUSER_BY_VY][2][l] -= x * gyy - y * gxy;
      lane[GROUSER_BY_YAW_RATE][0][l] -= wx;
      lane[GROUSER_BY_YAW_RATE][1][l] -= wy;
      lane[GROUSER_BY_YAW_RATE][2][l] -= x * wy - y * wx;
      if (!all) continue;
      lane[GROUSER_BY_BELT][0][l] += bx;
      lane[GROUSER_BY_BELT][1][l] += by;
      lane[GROUSER_BY_BELT][2][l] += x * by - y * bx;
      lane[GROUSER_BY_MODULUS][0][l] += kx;
      lane[GROUSER_BY_MODULUS][1][l] += ky;
      lane[GROUSER_BY_MODULUS][2][l] += x * ky - y * kx;
    }
  }
  memcpy(lane[GROUSER_BY_VY][0], lane[GROUSER_BY_VX][1], sizeof lane[GROUSER_BY_VY][0]);
  for (int s = 0; s < (all ? GROUSER_SLOPES : GROUSER_BODY_SLOPES); s++)
    for (int n = 0; n < GROUSER_OUTPUTS; n++) sums->slope[s][n] += lane_total(lane[s][n]);
}

void grouser_soft_slopes(const grouser_element_motion *m, const grouser_cell_strip *strip, enum grouser_wanted wanted,
                         grouser_element_sums *sums) {
  if (wanted == GROUSER_ALL_SLOPES_WANTED)
    add_slopes(m, strip, 1, sums);
  else
    add_slopes(m, strip, 0, sums);
}
