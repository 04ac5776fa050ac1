#include "body.h"

#include <string.h>

enum { LINE_SEARCH_LIMIT = 8 };

void grouser_level_row(const double *row, int columns, const grouser_footing *footing, int side, double *level) {
  memcpy(level, row, sizeof(double) * (size_t)columns);
  memcpy(level + GROUSER_TERRAIN, footing->theta[side], sizeof(double) * (size_t)(columns - GROUSER_TERRAIN));
  grouser_to_level(level, columns, footing->load_ratio);
}

/* Forces under the load m g_z: r times those of the level row. The slopes by the body scale alike; they may be NULL as
 * for grouser_blend_forces. */
static void evaluate(grouser_dynamics *dynamics, const double *row, double force[GROUSER_OUTPUTS],
                     double slope[GROUSER_OUTPUTS][3]) {
  const grouser_footing *footing = dynamics->footing;
  const int columns = dynamics->blend.primary->columns;
  double left[GROUSER_MAX_COLUMNS], right[GROUSER_MAX_COLUMNS];
  grouser_level_row(row, columns, footing, 0, left);
  if (footing->split) grouser_level_row(row, columns, footing, 1, right);
  grouser_blend_forces(&dynamics->blend, left, footing->split ? right : NULL, force, slope);
  for (int n = 0; n < GROUSER_OUTPUTS; n++) {
    force[n] *= footing->load_ratio;
    for (int q = 0; slope && q < 3; q++) slope[n][q] *= footing->load_ratio;
  }
}

static grouser_body body_of(const double *row) {
  const grouser_body body = {row[GROUSER_VX], row[GROUSER_VY], row[GROUSER_YAW_RATE]};
  return body;
}

static void set_body(double *row, grouser_body body) {
  row[GROUSER_VX] = body.vx;
  row[GROUSER_VY] = body.vy;
  row[GROUSER_YAW_RATE] = body.yaw_rate;
}

static grouser_body rates_of(const grouser_dynamics *dynamics, grouser_body body, const double *force) {
  return grouser_rates(dynamics->inertia, dynamics->footing->pull_x, dynamics->footing->pull_y, body, force);
}

/* y = anchor + gain f(y), as it is solved. */
typedef struct {
  grouser_body anchor;
  double gain, tolerance;
} stage;

typedef struct {
  grouser_body body;
  double force[GROUSER_OUTPUTS];
  int iterations;
} stage_solution;

/* Evaluates at `body`, into the row as well, and returns the residual there. */
static grouser_body residual_at(grouser_dynamics *dynamics, const stage *s, grouser_body body, double *row,
                                double *force, double slope[GROUSER_OUTPUTS][3]) {
  set_body(row, body);
  evaluate(dynamics, row, force, slope);
  return grouser_residual(body, s->anchor, s->gain, rates_of(dynamics, body, force));
}

/* Damped Newton from one guess; 0 if it does not converge. */
static int solve_stage(grouser_dynamics *dynamics, const double *start, const stage *s, grouser_body guess,
                       stage_solution *out) {
  double row[GROUSER_MAX_COLUMNS], slope[GROUSER_OUTPUTS][3];
  memcpy(row, start, sizeof row);
  grouser_body body = guess;
  grouser_body residual = residual_at(dynamics, s, body, row, out->force, slope);
  for (int iteration = 0; iteration <= GROUSER_NEWTON_LIMIT; iteration++) {
    const double size = grouser_residual_size(residual);
    if (size <= s->tolerance) {
      out->body = body;
      out->iterations = iteration;
      return 1;
    }
    if (iteration == GROUSER_NEWTON_LIMIT || !isfinite(size)) return 0;
    const grouser_inverse inverse = grouser_invert(dynamics->inertia, body, (const double(*)[3])slope, s->gain);
    const grouser_body direction = grouser_direction(&inverse, residual);
    if (!grouser_finite_body(direction)) return 0;
    double damping = 1.0;
    grouser_body trial = body;
    int accepted = 0;
    for (int n = 0; n < LINE_SEARCH_LIMIT && !accepted; n++, damping /= 2) {
      trial = grouser_along(body, damping, direction);
      residual = residual_at(dynamics, s, trial, row, out->force, slope);
      accepted = grouser_residual_size(residual) < size; /* NaN fails */
    }
    if (!accepted) return 0;
    body = trial;
  }
  return 0;
}

/* From a guess, or from rolling without slip: where ground grips hard, the solution is near there. */
static int solve_from_two_guesses(grouser_dynamics *dynamics, const double *row, const stage *s, grouser_body guess,
                                  stage_solution *out) {
  const double left = row[GROUSER_V_LEFT], right = row[GROUSER_V_RIGHT];
  const grouser_body rolling = {(left + right) / 2, 0.0, (right - left) / dynamics->tread};
  return solve_stage(dynamics, row, s, guess, out) || solve_stage(dynamics, row, s, rolling, out);
}

static int solve_part(grouser_dynamics *dynamics, const double *row, double step, double tolerance,
                      enum grouser_integrator integrator, stage_solution *out) {
  const grouser_body body = body_of(row);
  stage s = {body, step, tolerance};
  if (integrator != GROUSER_SDIRK2) return solve_from_two_guesses(dynamics, row, &s, body, out);
  s.gain = GROUSER_SDIRK_GAMMA * step;
  stage_solution first;
  if (!solve_from_two_guesses(dynamics, row, &s, body, &first)) return 0;
  s.anchor = grouser_along(body, (1.0 - GROUSER_SDIRK_GAMMA) * step, rates_of(dynamics, first.body, first.force));
  if (!solve_from_two_guesses(dynamics, row, &s, first.body, out)) return 0;
  out->iterations += first.iterations;
  return 1;
}

/* Broyden's steps from a body whose force and inverse are known; 0 where one does not shrink the residual. An
 * extrapolated body is not taken for a solved one: a vehicle near rest would chatter within the tolerance. */
static int solve_stage_by_broyden(grouser_dynamics *dynamics, double *row, const stage *s, grouser_inverse *inverse,
                                  int extrapolated, stage_solution *at) {
  grouser_body residual = grouser_residual(at->body, s->anchor, s->gain, rates_of(dynamics, at->body, at->force));
  grouser_body direction = grouser_direction(inverse, residual);
  double size = grouser_residual_size(residual);
  if (!extrapolated && size <= s->tolerance) return 1;
  for (int iteration = 0; iteration < GROUSER_BROYDEN_LIMIT && grouser_finite_body(direction); iteration++) {
    const double size_before = size;
    at->body = grouser_along(at->body, 1.0, direction);
    residual = residual_at(dynamics, s, at->body, row, at->force, NULL);
    direction = grouser_broyden_step(inverse, direction, residual);
    size = grouser_residual_size(residual);
    at->iterations++;
    /* A good guess may be nearer than the rounding of a step. */
    if (size <= s->tolerance) return 1;
    if (!(size < size_before)) return 0; /* NaN fails */
  }
  return 0;
}

/* The whole step from one evaluation with slopes. */
static int solve_by_broyden(grouser_dynamics *dynamics, const double *start, double step, double tolerance,
                            enum grouser_integrator integrator, grouser_body_step *out) {
  const grouser_body body = body_of(start);
  double *row = out->row, slope[GROUSER_OUTPUTS][3];
  stage s = {body, integrator == GROUSER_SDIRK2 ? GROUSER_SDIRK_GAMMA * step : step, tolerance};
  stage_solution at;
  memset(out->row, 0, sizeof out->row);
  memcpy(row, start, sizeof(double) * (size_t)dynamics->blend.primary->columns);
  at.iterations = 0;
  at.body = grouser_extrapolated(body, row[GROUSER_AX], row[GROUSER_AY], dynamics->yaw_acceleration,
                                 dynamics->footing->pull_x, dynamics->footing->pull_y, s.gain, tolerance);
  set_body(row, at.body);
  evaluate(dynamics, row, at.force, slope);
  grouser_inverse inverse = grouser_invert(dynamics->inertia, at.body, (const double(*)[3])slope, s.gain);
  if (!solve_stage_by_broyden(dynamics, row, &s, &inverse, !grouser_same_body(at.body, body), &at)) return 0;
  if (integrator == GROUSER_SDIRK2) {
    s.anchor = grouser_along(body, (1.0 - GROUSER_SDIRK_GAMMA) * step, rates_of(dynamics, at.body, at.force));
    if (!solve_stage_by_broyden(dynamics, row, &s, &inverse, 0, &at)) return 0;
  }
  out->body = at.body;
  memcpy(out->force, at.force, sizeof at.force);
  out->iterations = at.iterations;
  out->divisions = 1;
  return 1;
}

int grouser_implicit_step(grouser_dynamics *dynamics, const double *row, double step, double tolerance,
                          enum grouser_integrator integrator, grouser_body_step *out) {
  if (solve_by_broyden(dynamics, row, step, tolerance, integrator, out)) return 1;
  const size_t size = sizeof(double) * (size_t)dynamics->blend.primary->columns;
  for (int divisions = 1; divisions <= GROUSER_MAX_DIVISIONS; divisions *= 2) {
    double part[GROUSER_MAX_COLUMNS];
    stage_solution solution = {{0, 0, 0}, {0, 0, 0}, 0};
    int solved = 1;
    memset(part, 0, sizeof part);
    memcpy(part, row, size);
    out->iterations = 0;
    for (int n = 0; n < divisions && solved; n++) {
      solved = solve_part(dynamics, part, step / divisions, tolerance, integrator, &solution);
      out->iterations += solution.iterations;
      set_body(part, solution.body);
    }
    if (!solved) continue;
    out->body = solution.body;
    out->divisions = divisions;
    memcpy(out->row, part, sizeof part);
    memcpy(out->force, solution.force, sizeof solution.force);
    return 1;
  }
  return 0;
}

void grouser_explicit_step(grouser_dynamics *dynamics, const double *row, double step, grouser_body_step *out) {
  double slope[GROUSER_OUTPUTS][3];
  const size_t size = sizeof(double) * (size_t)dynamics->blend.primary->columns;
  memset(out->row, 0, sizeof out->row);
  memcpy(out->row, row, size);
  evaluate(dynamics, row, out->force, dynamics->blend.fallback ? slope : NULL);
  out->body = grouser_along(body_of(row), step, rates_of(dynamics, body_of(row), out->force));
  out->iterations = 0;
  out->divisions = 1;
}
