/* The body's equations of motion, Newton's and Broyden's steps: what a vehicle alone and a block of them share.
 * Equations and names: envs/tick.py. */
#ifndef GROUSER_BODY_H
#define GROUSER_BODY_H

#include <math.h>

#include "grouser/guard.h"
#include "grouser/tick.h"

enum { GROUSER_NEWTON_LIMIT = 8, GROUSER_BROYDEN_LIMIT = 12, GROUSER_MAX_DIVISIONS = 16 };

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

/* Of I - gain df/dy, or what the steps since have made of it. */
typedef struct {
  double entry[3][3];
} grouser_inverse;

/* By cofactors; not finite where the matrix is singular. */
static inline grouser_inverse grouser_invert(grouser_inertia inertia, grouser_body body,
                                             const double slope[GROUSER_OUTPUTS][3], double gain) {
  const double by_mass = gain / inertia.mass, by_inertia = gain / inertia.yaw_inertia;
  const double a = 1.0 - by_mass * slope[0][0], b = -by_mass * slope[0][1] - gain * body.yaw_rate,
               c = -by_mass * slope[0][2] - gain * body.vy;
  const double d = -by_mass * slope[1][0] + gain * body.yaw_rate, e = 1.0 - by_mass * slope[1][1],
               f = -by_mass * slope[1][2] + gain * body.vx;
  const double g = -by_inertia * slope[2][0], h = -by_inertia * slope[2][1], i = 1.0 - by_inertia * slope[2][2];
  const double ca = e * i - f * h, cb = f * g - d * i, cc = d * h - e * g;
  const double determinant = a * ca + b * cb + c * cc;
  /* Zero over zero is NaN, and so is an infinite determinant times 0: both must not pass for an inverse. */
  const double spoilt = determinant * 0.0;
  const grouser_inverse inverse = {
      {{ca / determinant + spoilt, (c * h - b * i) / determinant, (b * f - c * e) / determinant},
       {cb / determinant, (a * i - c * g) / determinant, (c * d - a * f) / determinant},
       {cc / determinant, (b * g - a * h) / determinant, (a * e - b * d) / determinant}}};
  return inverse;
}

/* -H r. */
static inline grouser_body grouser_direction(const grouser_inverse *inverse, grouser_body residual) {
  const double(*h)[3] = inverse->entry;
  const grouser_body direction = {-(h[0][0] * residual.vx + h[0][1] * residual.vy + h[0][2] * residual.yaw_rate),
                                  -(h[1][0] * residual.vx + h[1][1] * residual.vy + h[1][2] * residual.yaw_rate),
                                  -(h[2][0] * residual.vx + h[2][1] * residual.vy + h[2][2] * residual.yaw_rate)};
  return direction;
}

/* After a step that left this residual: Broyden's update of the inverse, and the next step. With u = -H r they are
 * H + u (step' H) / (step'(step - u)) and u step'step / (step'(step - u)). */
static inline grouser_body grouser_broyden_step(grouser_inverse *inverse, grouser_body step, grouser_body residual) {
  double(*h)[3] = inverse->entry;
  const grouser_body u = grouser_direction(inverse, residual);
  const double square = step.vx * step.vx + step.vy * step.vy + step.yaw_rate * step.yaw_rate;
  const double share = 1.0 / (square - (step.vx * u.vx + step.vy * u.vy + step.yaw_rate * u.yaw_rate));
  const double row[3] = {share * (step.vx * h[0][0] + step.vy * h[1][0] + step.yaw_rate * h[2][0]),
                         share * (step.vx * h[0][1] + step.vy * h[1][1] + step.yaw_rate * h[2][1]),
                         share * (step.vx * h[0][2] + step.vy * h[1][2] + step.yaw_rate * h[2][2])};
  for (int j = 0; j < 3; j++) {
    h[0][j] += u.vx * row[j];
    h[1][j] += u.vy * row[j];
    h[2][j] += u.yaw_rate * row[j];
  }
  const double length = share * square;
  const grouser_body next = {length * u.vx, length * u.vy, length * u.yaw_rate};
  return next;
}

static inline int grouser_same_body(grouser_body a, grouser_body b) {
  return (a.vx == b.vx) & (a.vy == b.vy) & (a.yaw_rate == b.yaw_rate);
}

/* The first guess: where the forces of the last tick would take the body, and its yaw rate as the belts change; the body
 * itself if that is within the tolerance. */
static inline grouser_body grouser_extrapolated(grouser_body body, double ax, double ay, double yaw_acceleration,
                                                double pull_x, double pull_y, double gain, double tolerance) {
  const grouser_body change = {gain * (ax + pull_x + body.yaw_rate * body.vy),
                               gain * (ay + pull_y - body.yaw_rate * body.vx), gain * yaw_acceleration};
  return grouser_residual_size(change) <= tolerance ? body : grouser_along(body, 1.0, change);
}

static inline int grouser_finite_body(grouser_body body) { return isfinite(body.vx + body.vy + body.yaw_rate); }

/* What moves the body during one tick. */
typedef struct {
  grouser_inertia inertia;
  double tread; /* m */
  const grouser_footing *footing;
  double yaw_acceleration; /* rad/s^2, that is to be expected */
  grouser_blend blend;
} grouser_dynamics;

/* A solved step: the row as the block received it, and what it returned. */
typedef struct {
  grouser_body body;
  double row[GROUSER_MAX_COLUMNS];
  double force[GROUSER_OUTPUTS];
  int iterations, divisions;
} grouser_body_step;

/* A row as level ground would have it: accelerations and cohesion over the load ratio. */
static inline void grouser_to_level(double *row, int columns, double load_ratio) {
  row[GROUSER_AX] /= load_ratio;
  row[GROUSER_AY] /= load_ratio;
  if (columns == grouser_columns(GROUSER_SOIL)) row[GROUSER_TERRAIN] /= load_ratio;
}

/* Writes the row of one track on level ground. */
void grouser_level_row(const double *row, int columns, const grouser_footing *footing, int side, double *level);

/* Advances the body of `row` by `step` s; 0 if sixteenths of it were not solved either. */
int grouser_implicit_step(grouser_dynamics *dynamics, const double *row, double step, double tolerance,
                          enum grouser_integrator integrator, grouser_body_step *out);
void grouser_explicit_step(grouser_dynamics *dynamics, const double *row, double step, grouser_body_step *out);

#endif
