#include <math.h>
#include <string.h>

#include "cells.h"

static const double PI = 3.14159265358979323846;
/* Below this angle S and C are their first terms to the last bit. */
static const double STRAIGHT = 1e-12;

/* What is the same for every cell at one place along the element. The vehicle's velocity, turned back through theta =
 * omega t and integrated over the contact time t, moves a point by t [[S, C], [-C, S]] v, S = sin(theta)/theta,
 * C = (1 - cos(theta))/theta. */
typedef struct {
  double time, time_by_belt, time_by_yaw_rate;
  double sine, cosine, s, c;
} station;

static station station_at(const grouser_element_motion *m, double offset) {
  const double ahead = offset + m->reach;
  const double travelled = m->half_travel - m->direction * ahead;
  station at;
  at.time = travelled / m->soft_belt;
  at.time_by_yaw_rate = 0;
  at.time_by_belt = -(m->direction_slope * ahead + at.time * m->direction) / m->soft_belt;
  /* A chord shrinks again beyond half a turn, the shear does not: the path counts back to half a turn at most. */
  if (fabs(m->yaw_rate) * at.time > PI) {
    at.time = PI / fabs(m->yaw_rate);
    at.time_by_belt = 0;
    at.time_by_yaw_rate = -at.time / m->yaw_rate;
  }
  const double theta = m->yaw_rate * at.time;
  const double half_sine = sin(theta / 2), half_cosine = cos(theta / 2);
  at.sine = 2 * half_sine * half_cosine;
  at.cosine = 1 - 2 * half_sine * half_sine;
  const int turning = fabs(theta) > STRAIGHT;
  at.s = turning ? at.sine / theta : 1.0;
  at.c = turning ? 2 * half_sine * half_sine / theta : theta / 2;
  return at;
}

/* Slip velocity (a, b) of a cell, its size and direction; shear displacement (x, y) and its size; exp(-z) - 1. */
typedef struct {
  double a, b, sliding, along, aside;
  double x, y, displacement, rise;
} shear;

static shear shear_at(const grouser_element_motion *m, const station *at, double x, double y) {
  shear j;
  j.a = m->vx - m->yaw_rate * y - m->belt;
  j.b = m->vy + m->yaw_rate * x;
  j.x = at->time * (at->s * j.a + at->c * j.b + m->belt * (at->s - at->cosine));
  j.y = at->time * (at->s * j.b - at->c * j.a + m->belt * (at->sine - at->c));
  j.sliding = sqrt(j.a * j.a + j.b * j.b);
  j.displacement = sqrt(j.x * j.x + j.y * j.y);
  j.along = j.sliding > 0 ? j.a / j.sliding : 0.0;
  j.aside = j.sliding > 0 ? j.b / j.sliding : 0.0;
  j.rise = expm1(-j.displacement / m->modulus);
  return j;
}

void grouser_exact_forces(const grouser_element_motion *m, const grouser_cell_strip *strip,
                          grouser_element_sums *sums) {
  station at = station_at(m, strip->offset[0]);
  for (int n = 0; n < strip->count; n++) {
    if (n > 0 && strip->offset[n] != strip->offset[n - 1]) at = station_at(m, strip->offset[n]);
    const double x = m->center + strip->offset[n], y = strip->y[n];
    const shear j = shear_at(m, &at, x, y);
    const double fx = j.rise * j.along, fy = j.rise * j.aside;
    sums->force[0] += fx;
    sums->force[1] += fy;
    sums->force[2] += x * fy - y * fx;
  }
}

/* dF = -exp(-z) dz n + (exp(-z) - 1) dn with z = |j|/K and n the direction of sliding: dz = j'dj/(|j| K),
 * dn = (dv - n n'dv)/|v|. Where both sliding and displacement vanish, F = -(t/K) v. */
static inline void add_slope(const grouser_element_motion *m, const station *at, const shear *j, double x, double y, int by,
                      double da, double db, double djx, double djy, grouser_element_sums *sums) {
  double fx, fy;
  if (j->sliding > 0) {
    const double dz = j->displacement > 0 ? (j->x * djx + j->y * djy) / (j->displacement * m->modulus) : 0.0;
    const double towards = j->along * da + j->aside * db;
    const double decay = -(1 + j->rise) * dz, turn = j->rise / j->sliding;
    fx = decay * j->along + turn * (da - j->along * towards);
    fy = decay * j->aside + turn * (db - j->aside * towards);
  } else {
    const double gain = j->displacement > 0 ? 0.0 : -at->time / m->modulus;
    fx = gain * da;
    fy = gain * db;
  }
  sums->slope[by][0] += fx;
  sums->slope[by][1] += fy;
  sums->slope[by][2] += x * fy - y * fx;
}

void grouser_exact_slopes(const grouser_element_motion *m, const grouser_cell_strip *strip, enum grouser_wanted wanted,
                          grouser_element_sums *sums) {
  station at = station_at(m, strip->offset[0]);
  for (int n = 0; n < strip->count; n++) {
    if (n > 0 && strip->offset[n] != strip->offset[n - 1]) at = station_at(m, strip->offset[n]);
    const double x = m->center + strip->offset[n], y = strip->y[n], t = at.time;
    const shear j = shear_at(m, &at, x, y);
    const double theta = m->yaw_rate * t;
    const int turning = fabs(theta) > 1e-5;
    const double s_slope = turning ? (at.cosine - at.s) / theta : -theta / 3;
    const double c_slope = turning ? (at.sine - at.c) / theta : 0.5;
    /* The path by its length in time, which the belt speed changes, and past half a turn the yaw rate. */
    const double by_time_x = at.cosine * j.a + at.sine * (j.b + m->belt * theta);
    const double by_time_y = at.cosine * (j.b + m->belt * theta) - at.sine * j.a;
    const double by_theta_x = t * (s_slope * j.a + c_slope * j.b + m->belt * (s_slope + at.sine));
    const double by_theta_y = t * (s_slope * j.b - c_slope * j.a + m->belt * (at.cosine - c_slope));
    add_slope(m, &at, &j, x, y, GROUSER_BY_VX, 1, 0, t * at.s, -t * at.c, sums);
    add_slope(m, &at, &j, x, y, GROUSER_BY_VY, 0, 1, t * at.c, t * at.s, sums);
    add_slope(m, &at, &j, x, y, GROUSER_BY_YAW_RATE, -y, x,
              t * (by_theta_x - y * at.s + x * at.c) + by_time_x * at.time_by_yaw_rate,
              t * (by_theta_y + y * at.c + x * at.s) + by_time_y * at.time_by_yaw_rate, sums);
    if (wanted != GROUSER_ALL_SLOPES_WANTED) continue;
    add_slope(m, &at, &j, x, y, GROUSER_BY_BELT, -1, 0, by_time_x * at.time_by_belt - t * at.cosine,
              by_time_y * at.time_by_belt + t * at.sine, sums);
    /* j/K is all that K is in: its slope is that of a displacement by -j/K. */
    add_slope(m, &at, &j, x, y, GROUSER_BY_MODULUS, 0, 0, -j.x / m->modulus, -j.y / m->modulus, sums);
  }
}
