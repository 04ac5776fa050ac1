#include "fleet_deck.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

static grouser_body body_in(const grouser_deck *deck, int l) {
  const grouser_body body = {deck->left.column[GROUSER_VX][l], deck->left.column[GROUSER_VY][l],
                             deck->left.column[GROUSER_YAW_RATE][l]};
  return body;
}

static void put_body(grouser_deck *deck, int l, grouser_body body) {
  deck->left.column[GROUSER_VX][l] = deck->right.column[GROUSER_VX][l] = body.vx;
  deck->left.column[GROUSER_VY][l] = deck->right.column[GROUSER_VY][l] = body.vy;
  deck->left.column[GROUSER_YAW_RATE][l] = deck->right.column[GROUSER_YAW_RATE][l] = body.yaw_rate;
}

static void begin_stage(grouser_deck *deck, int l, grouser_body anchor, int stage) {
  deck->anchor[0][l] = anchor.vx;
  deck->anchor[1][l] = anchor.vy;
  deck->anchor[2][l] = anchor.yaw_rate;
  deck->stage[l] = stage;
  deck->iteration[l] = 0;
}

static void put_row(grouser_block_rows *rows, int columns, int l, const double *row) {
  for (int n = 0; n < columns; n++) rows->column[n][l] = row[n];
}

void grouser_deck_enter(grouser_deck *deck, int lane, const grouser_tick_start *start) {
  const int columns = deck->kernel->columns;
  double level[GROUSER_MAX_COLUMNS];
  grouser_level_row(start->row, columns, &start->footing, 0, level);
  put_row(&deck->left, columns, lane, level);
  if (start->footing.split) {
    grouser_level_row(start->row, columns, &start->footing, 1, level);
    put_row(&deck->right, columns, lane, level);
  }
  deck->pull[0][lane] = start->footing.pull_x;
  deck->pull[1][lane] = start->footing.pull_y;
  deck->yaw_inertia[lane] = start->traits->yaw_inertia;
  deck->load_ratio[lane] = start->footing.load_ratio;
  deck->iterations[lane] = 0;
  deck->active[lane] = 1;
  begin_stage(deck, lane, body_in(deck, lane), 0);
}

/* The forces of one lane after another, where the kernel has no block. */
static void evaluate_lanes(grouser_deck *deck, int split, int want_slopes) {
  const grouser_kernel *kernel = deck->kernel;
  for (int l = 0; l < GROUSER_BLOCK; l++) {
    if (!deck->active[l]) continue;
    double left[GROUSER_MAX_COLUMNS], right[GROUSER_MAX_COLUMNS];
    double force[GROUSER_OUTPUTS], slope[GROUSER_OUTPUTS][3];
    for (int n = 0; n < kernel->columns; n++) {
      left[n] = deck->left.column[n][l];
      right[n] = deck->right.column[n][l];
    }
    grouser_kernel_forces(kernel, left, split ? right : NULL, force, want_slopes ? slope : NULL);
    for (int n = 0; n < GROUSER_OUTPUTS; n++) {
      deck->forces.force[n][l] = force[n];
      for (int q = 0; want_slopes && q < 3; q++) deck->forces.slope[n][q][l] = slope[n][q];
    }
  }
}

/* Residual and Newton direction of every lane, and the forces under its load. */
static void newton_step(grouser_deck *deck, double mass, double gain) {
  for (int l = 0; l < GROUSER_BLOCK; l++) {
    const grouser_inertia inertia = {mass, deck->yaw_inertia[l]};
    const double ratio = deck->load_ratio[l];
    const grouser_body body = {deck->left.column[GROUSER_VX][l], deck->left.column[GROUSER_VY][l],
                               deck->left.column[GROUSER_YAW_RATE][l]};
    const grouser_body anchor = {deck->anchor[0][l], deck->anchor[1][l], deck->anchor[2][l]};
    const grouser_block_forces *f = &deck->forces;
    const double force[GROUSER_OUTPUTS] = {ratio * f->force[0][l], ratio * f->force[1][l], ratio * f->force[2][l]};
    const double slope[GROUSER_OUTPUTS][3] = {
        {ratio * f->slope[0][0][l], ratio * f->slope[0][1][l], ratio * f->slope[0][2][l]},
        {ratio * f->slope[1][0][l], ratio * f->slope[1][1][l], ratio * f->slope[1][2][l]},
        {ratio * f->slope[2][0][l], ratio * f->slope[2][1][l], ratio * f->slope[2][2][l]}};
    const grouser_body rates = grouser_rates(inertia, deck->pull[0][l], deck->pull[1][l], body, force);
    const grouser_body residual = grouser_residual(body, anchor, gain, rates);
    const grouser_body direction = grouser_newton_direction(inertia, body, slope, residual, gain);
    const double sum = slope[0][0] + slope[0][1] + slope[0][2] + slope[1][0] + slope[1][1] + slope[1][2] +
                       slope[2][0] + slope[2][1] + slope[2][2];
    deck->spoilt[l] = sum * 0.0; /* NaN where a slope is not finite */
    deck->size[l] = grouser_residual_size(residual);
    deck->direction[0][l] = direction.vx;
    deck->direction[1][l] = direction.vy;
    deck->direction[2][l] = direction.yaw_rate;
    for (int n = 0; n < GROUSER_OUTPUTS; n++) deck->forces.force[n][l] = force[n];
  }
}

/* Up to as many lanes, one by one costs less than a whole block: to the same bits. */
enum { FEW_LANES = 4 };

/* An explicit step goes without, save that a primary whose slopes are not finite has failed. */
static int wants_slopes(const grouser_plant *plant) { return plant->integrator != GROUSER_EULER || plant->guard; }

static int busy_lanes(const grouser_deck *deck) {
  int busy = 0;
  for (int l = 0; l < GROUSER_BLOCK; l++) busy += deck->active[l] != 0;
  return busy;
}

void grouser_deck_evaluate(grouser_deck *deck, const grouser_plant *plant) {
  const grouser_kernel *kernel = deck->kernel;
  const int split = plant->sampling.tracks, want_slopes = wants_slopes(plant);
  if (kernel->evaluate_block && !(kernel->evaluate_body && busy_lanes(deck) <= FEW_LANES))
    kernel->evaluate_block(kernel->self, &deck->left, split ? &deck->right : &deck->left, want_slopes, &deck->forces);
  else
    evaluate_lanes(deck, split, want_slopes);
  newton_step(deck, plant->vehicle.mass,
              plant->integrator == GROUSER_SDIRK2 ? GROUSER_SDIRK_GAMMA * plant->step : plant->step);
}

static void read_solution(const grouser_deck *deck, int l, const grouser_tick_start *start,
                          grouser_body_step *solution) {
  solution->body = body_in(deck, l);
  memcpy(solution->row, start->row, sizeof solution->row);
  solution->row[GROUSER_VX] = solution->body.vx;
  solution->row[GROUSER_VY] = solution->body.vy;
  solution->row[GROUSER_YAW_RATE] = solution->body.yaw_rate;
  for (int n = 0; n < GROUSER_OUTPUTS; n++) solution->force[n] = deck->forces.force[n][l];
  solution->iterations = deck->iterations[l];
  solution->divisions = 1;
}

static grouser_body rates_in(const grouser_deck *deck, double mass, int l, const grouser_body_step *solution) {
  const grouser_inertia inertia = {mass, deck->yaw_inertia[l]};
  return grouser_rates(inertia, deck->pull[0][l], deck->pull[1][l], solution->body, solution->force);
}

enum grouser_progress grouser_deck_proceed(grouser_deck *deck, const grouser_plant *plant, int l,
                                           const grouser_tick_start *start, grouser_body_step *solution) {
  const double size = deck->size[l];
  const int sound = isfinite(size) && (!wants_slopes(plant) || isfinite(deck->spoilt[l]));
  deck->active[l] = 0;
  if (!sound) return GROUSER_STUCK;
  if (plant->integrator == GROUSER_EULER) {
    read_solution(deck, l, start, solution);
    solution->body = grouser_along(solution->body, plant->step, rates_in(deck, plant->vehicle.mass, l, solution));
    return GROUSER_CONVERGED;
  }
  if (deck->iteration[l] > 0 && !(size < deck->size_before[l])) return GROUSER_STUCK;
  if (size <= plant->tolerance) {
    deck->iterations[l] += deck->iteration[l];
    read_solution(deck, l, start, solution);
    if (plant->integrator != GROUSER_SDIRK2 || deck->stage[l] > 0) return GROUSER_CONVERGED;
    const grouser_body body = {start->row[GROUSER_VX], start->row[GROUSER_VY], start->row[GROUSER_YAW_RATE]};
    const grouser_body rates = rates_in(deck, plant->vehicle.mass, l, solution);
    begin_stage(deck, l, grouser_along(body, (1.0 - GROUSER_SDIRK_GAMMA) * plant->step, rates), 1);
  } else {
    const grouser_body direction = {deck->direction[0][l], deck->direction[1][l], deck->direction[2][l]};
    if (deck->iteration[l] == GROUSER_NEWTON_LIMIT || !grouser_finite_body(direction)) return GROUSER_STUCK;
    deck->size_before[l] = size;
    deck->iteration[l]++;
    put_body(deck, l, grouser_along(body_in(deck, l), 1.0, direction));
  }
  deck->active[l] = 1;
  return GROUSER_ITERATES;
}
