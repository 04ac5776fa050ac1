/* The body's equations of motion and one damped Newton step: what a vehicle alone and a block of them share.
 * Equations and names: envs/tick.py. */
#ifndef GROUSER_BODY_H
#define GROUSER_BODY_H

#include <math.h>

#include "grouser/guard.h"
#include "grouser/tick.h"

enum { GROUSER_NEWTON_LIMIT = 8, GROUSER_MAX_DIVISIONS = 16 };

/* 1 - 1/sqrt(2), of the two-stage method. */
#define GROUSER_SDIRK_GAMMA (1.0 - 0.7071067811865475)

typedef struct {
  double vx, vy, yaw_rate;
} grouser_body;

static inline grouser_body grouser_along(grouser_body start, double length, grouser_body direction) {
  const grouser_body end = {start.vx + length * direction.vx, start.vy + length * direction.vy,
                            start.yaw_rate + length * direction.yaw_rate};
  return end;
}

typedef struct {
  double mass, yaw_inertia; /* kg, kg m^2 */
} grouser_inertia;

/* f(y) = (Qx/m + g_x + w Vy, Qy/m + g_y - w Vx, Mz/I_z). */
static inline grouser_body grouser_rates(grouser_inertia inertia, double pull_x, double pull_y, grouser_body body,
                                         const double force[GROUSER_OUTPUTS]) {
  const grouser_body rates = {force[0] / inertia.mass + pull_x + body.yaw_rate * body.vy,
                              force[1] / inertia.mass + pull_y - body.yaw_rate * body.vx,
                              force[2] / inertia.yaw_inertia};
  return rates;
}

/* y - anchor - gain f(y). */
static inline grouser_body grouser_residual(grouser_body body, grouser_body anchor, double gain, grouser_body rates) {
  const grouser_body residual = {body.vx - anchor.vx - gain * rates.vx, body.vy - anchor.vy - gain * rates.vy,
                                 body.yaw_rate - anchor.yaw_rate - gain * rates.yaw_rate};
  return residual;
}

/* Not the largest part: a maximum may drop a NaN. */
static inline double grouser_residual_size(grouser_body residual) {
  return fabs(residual.vx) + fabs(residual.vy) + fabs(residual.yaw_rate);
}

/* Solves (I - gain df/dy) delta = -residual by cofactors; not finite where the matrix is singular. */
static inline grouser_body grouser_newton_direction(grouser_inertia inertia, grouser_body body,
                                                    const double slope[GROUSER_OUTPUTS][3], grouser_body residual,
                                                    double gain) {
  const double by_mass = gain / inertia.mass, by_inertia = gain / inertia.yaw_inertia;
  const double a = 1.0 - by_mass * slope[0][0], b = -by_mass * slope[0][1] - gain * body.yaw_rate,
               c = -by_mass * slope[0][2] - gain * body.vy;
  const double d = -by_mass * slope[1][0] + gain * body.yaw_rate, e = 1.0 - by_mass * slope[1][1],
               f = -by_mass * slope[1][2] + gain * body.vx;
  const double g = -by_inertia * slope[2][0], h = -by_inertia * slope[2][1], i = 1.0 - by_inertia * slope[2][2];
  const double ca = e * i - f * h, cb = f * g - d * i, cc = d * h - e * g;
  const double determinant = a * ca + b * cb + c * cc;
  const double r = residual.vx, s = residual.vy, t = residual.yaw_rate;
  /* Zero over zero is NaN, and so is an infinite determinant times 0: both must not pass for a direction. */
  const double spoilt = determinant * 0.0;
  const grouser_body direction = {
      -(ca * r + (c * h - b * i) * s + (b * f - c * e) * t) / determinant + spoilt,
      -(cb * r + (a * i - c * g) * s + (c * d - a * f) * t) / determinant,
      -(cc * r + (b * g - a * h) * s + (a * e - b * d) * t) / determinant};
  return direction;
}

static inline int grouser_finite_body(grouser_body body) { return isfinite(body.vx + body.vy + body.yaw_rate); }

/* What moves the body during one tick. */
typedef struct {
  grouser_inertia inertia;
  double tread; /* m */
  const grouser_footing *footing;
  grouser_blend blend;
} grouser_dynamics;

/* A solved step: the row as the block received it, and what it returned. */
typedef struct {
  grouser_body body;
  double row[GROUSER_MAX_COLUMNS];
  double force[GROUSER_OUTPUTS];
  int iterations, divisions;
} grouser_body_step;

/* Writes the row of one track as level ground would have it: accelerations and cohesion over the load ratio. */
void grouser_level_row(const double *row, int columns, const grouser_footing *footing, int side, double *level);

/* Advances the body of `row` by `step` s; 0 if sixteenths of it were not solved either. */
int grouser_implicit_step(grouser_dynamics *dynamics, const double *row, double step, double tolerance,
                          enum grouser_integrator integrator, grouser_body_step *out);
void grouser_explicit_step(grouser_dynamics *dynamics, const double *row, double step, grouser_body_step *out);

#endif
