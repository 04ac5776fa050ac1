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

static double gain_of(const grouser_plant *plant) {
  return plant->integrator == GROUSER_SDIRK2 ? GROUSER_SDIRK_GAMMA * plant->step : plant->step;
}

static void put_row(grouser_block_rows *rows, int columns, int l, const double *row) {
  for (int n = 0; n < columns; n++) rows->column[n][l] = row[n];
}

void grouser_deck_enter(grouser_deck *deck, const grouser_plant *plant, int columns, int lane,
                        const grouser_tick_start *start) {
  double level[GROUSER_MAX_COLUMNS];
  grouser_level_row(start->row, columns, &start->footing, 0, level);
  put_row(&deck->left, columns, lane, level);
  if (start->footing.split) {
    grouser_level_row(start->row, columns, &start->footing, 1, level);
    put_row(&deck->right, columns, lane, level);
  }
  deck->anchor[0][lane] = start->row[GROUSER_VX];
  deck->anchor[1][lane] = start->row[GROUSER_VY];
  deck->anchor[2][lane] = start->row[GROUSER_YAW_RATE];
  deck->pull[0][lane] = start->footing.pull_x;
  deck->pull[1][lane] = start->footing.pull_y;
  deck->load_ratio[lane] = start->footing.load_ratio;
  deck->yaw_inertia[lane] = start->traits->yaw_inertia;
  deck->stage[lane] = deck->iteration[lane] = deck->iterations[lane] = 0;
  deck->active[lane] = 1;
  if (plant->integrator != GROUSER_EULER)
    put_body(deck, lane, grouser_extrapolated(start->row, &start->footing, start->yaw_acceleration, gain_of(plant),
                                              plant->tolerance));
}

void grouser_deck_move(grouser_deck *from, int lane, grouser_deck *to, int free_lane, const grouser_kernel *kernel,
                       int split) {
  for (int r = 0; r < kernel->prepared_rows; r++) to->prepared[r][free_lane] = from->prepared[r][lane];
  for (int n = 0; n < kernel->columns; n++) {
    to->left.column[n][free_lane] = from->left.column[n][lane];
    if (split) to->right.column[n][free_lane] = from->right.column[n][lane];
  }
  for (int q = 0; q < 3; q++) {
    to->anchor[q][free_lane] = from->anchor[q][lane];
    to->step[q][free_lane] = from->step[q][lane];
    for (int p = 0; p < 3; p++) to->inverse[q][p][free_lane] = from->inverse[q][p][lane];
  }
  for (int q = 0; q < 2; q++) to->pull[q][free_lane] = from->pull[q][lane];
  to->load_ratio[free_lane] = from->load_ratio[lane];
  to->yaw_inertia[free_lane] = from->yaw_inertia[lane];
  to->size_before[free_lane] = from->size_before[lane];
  to->stage[free_lane] = from->stage[lane];
  to->iteration[free_lane] = from->iteration[lane];
  to->iterations[free_lane] = from->iterations[lane];
  to->active[free_lane] = 1;
  from->active[lane] = 0;
}

/* The forces of one lane after another, where the kernel has no block. */
static void evaluate_lanes(grouser_deck *deck, const grouser_kernel *kernel, int split,
                           enum grouser_slopes_wanted wanted) {
  for (int l = 0; l < GROUSER_BLOCK; l++) {
    if (!deck->active[l]) continue;
    double left[GROUSER_MAX_COLUMNS], right[GROUSER_MAX_COLUMNS];
    double force[GROUSER_OUTPUTS], slope[GROUSER_OUTPUTS][3];
    for (int n = 0; n < kernel->columns; n++) {
      left[n] = deck->left.column[n][l];
      right[n] = deck->right.column[n][l];
    }
    grouser_kernel_forces(kernel, left, split ? right : NULL, wanted, force, slope);
    for (int n = 0; n < GROUSER_OUTPUTS; n++) {
      deck->forces.force[n][l] = force[n];
      for (int q = 0; wanted && q < 3; q++) deck->forces.slope[n][q][l] = slope[n][q];
    }
  }
}

/* Up to as many lanes, one by one costs less than a whole block: to the same bits. */
enum { FEW_LANES = 4 };

static void evaluate(grouser_deck *deck, const grouser_plant *plant, const grouser_kernel *kernel,
                     enum grouser_slopes_wanted wanted) {
  const int split = plant->sampling.tracks;
  int busy = 0;
  for (int l = 0; l < GROUSER_BLOCK; l++) busy += deck->active[l] != 0;
  if (kernel->evaluate_block && !(kernel->evaluate_body && busy <= FEW_LANES))
    kernel->evaluate_block(kernel->self, &deck->left, split ? &deck->right : &deck->left,
                           (const double(*)[GROUSER_BLOCK])deck->prepared, wanted, &deck->forces);
  else
    evaluate_lanes(deck, kernel, split, wanted);
}

static grouser_inertia inertia_in(const grouser_deck *deck, const grouser_plant *plant, int l) {
  const grouser_inertia inertia = {plant->vehicle.mass, deck->yaw_inertia[l]};
  return inertia;
}

static grouser_inverse inverse_in(const grouser_deck *deck, int l) {
  const grouser_inverse inverse = {{{deck->inverse[0][0][l], deck->inverse[0][1][l], deck->inverse[0][2][l]},
                                    {deck->inverse[1][0][l], deck->inverse[1][1][l], deck->inverse[1][2][l]},
                                    {deck->inverse[2][0][l], deck->inverse[2][1][l], deck->inverse[2][2][l]}}};
  return inverse;
}

static void put_inverse(grouser_deck *deck, int l, const grouser_inverse *inverse) {
  for (int q = 0; q < 3; q++)
    for (int p = 0; p < 3; p++) deck->inverse[q][p][l] = inverse->entry[q][p];
}

static grouser_body step_in(const grouser_deck *deck, int l) {
  const grouser_body step = {deck->step[0][l], deck->step[1][l], deck->step[2][l]};
  return step;
}

static void put_step(grouser_deck *deck, int l, grouser_body step) {
  deck->step[0][l] = step.vx;
  deck->step[1][l] = step.vy;
  deck->step[2][l] = step.yaw_rate;
}

static grouser_body rates_in(const grouser_deck *deck, const grouser_plant *plant, int l) {
  const double force[GROUSER_OUTPUTS] = {deck->forces.force[0][l], deck->forces.force[1][l], deck->forces.force[2][l]};
  return grouser_rates(inertia_in(deck, plant, l), deck->pull[0][l], deck->pull[1][l], body_in(deck, l), force);
}

static grouser_body anchor_in(const grouser_deck *deck, int l) {
  const grouser_body anchor = {deck->anchor[0][l], deck->anchor[1][l], deck->anchor[2][l]};
  return anchor;
}

static grouser_body residual_in(const grouser_deck *deck, const grouser_plant *plant, int l, double gain) {
  return grouser_residual(body_in(deck, l), anchor_in(deck, l), gain, rates_in(deck, plant, l));
}

/* Forces under the load of each lane. */
static void load_forces(grouser_deck *deck) {
  for (int n = 0; n < GROUSER_OUTPUTS; n++)
    for (int l = 0; l < GROUSER_BLOCK; l++) deck->forces.force[n][l] *= deck->load_ratio[l];
}

/* An explicit step goes without, save that a primary whose slopes are not finite has failed. */
static int wants_slopes(const grouser_plant *plant) { return plant->integrator != GROUSER_EULER || plant->guard; }

void grouser_deck_open(grouser_deck *deck, const grouser_plant *plant, const grouser_kernel *kernel) {
  const double gain = gain_of(plant);
  const int want_slopes = wants_slopes(plant);
  if (kernel->prepare_block)
    kernel->prepare_block(kernel->self, &deck->left, plant->sampling.tracks ? &deck->right : &deck->left, deck->prepared);
  evaluate(deck, plant, kernel, want_slopes ? GROUSER_LEADING_SLOPES : GROUSER_NO_SLOPES);
  load_forces(deck);
  for (int l = 0; want_slopes && l < GROUSER_BLOCK; l++) {
    const double ratio = deck->load_ratio[l];
    const grouser_block_forces *f = &deck->forces;
    const double slope[GROUSER_OUTPUTS][3] = {
        {ratio * f->slope[0][0][l], ratio * f->slope[0][1][l], ratio * f->slope[0][2][l]},
        {ratio * f->slope[1][0][l], ratio * f->slope[1][1][l], ratio * f->slope[1][2][l]},
        {ratio * f->slope[2][0][l], ratio * f->slope[2][1][l], ratio * f->slope[2][2][l]}};
    const grouser_inverse inverse = grouser_invert(inertia_in(deck, plant, l), body_in(deck, l), slope, gain);
    put_inverse(deck, l, &inverse);
  }
  for (int l = 0; l < GROUSER_BLOCK; l++) {
    const grouser_inverse inverse = inverse_in(deck, l);
    const grouser_body residual = residual_in(deck, plant, l, gain);
    put_step(deck, l, grouser_direction(&inverse, residual));
    deck->size[l] = grouser_residual_size(residual);
  }
}

void grouser_deck_follow(grouser_deck *deck, const grouser_plant *plant, const grouser_kernel *kernel) {
  const double gain = gain_of(plant);
  evaluate(deck, plant, kernel, GROUSER_NO_SLOPES);
  load_forces(deck);
  for (int l = 0; l < GROUSER_BLOCK; l++) {
    grouser_inverse inverse = inverse_in(deck, l);
    const grouser_body residual = residual_in(deck, plant, l, gain);
    put_step(deck, l, grouser_broyden_step(&inverse, step_in(deck, l), residual));
    put_inverse(deck, l, &inverse);
    deck->size[l] = grouser_residual_size(residual);
  }
}

/* Whether forces and, in the first evaluation, slopes are finite. */
static int is_sound(const grouser_deck *deck, const grouser_plant *plant, int l) {
  double spoilt = deck->size[l] * 0.0;
  for (int n = 0; deck->iterations[l] == 0 && wants_slopes(plant) && n < GROUSER_OUTPUTS; n++)
    for (int q = 0; q < 3; q++) spoilt += deck->forces.slope[n][q][l] * 0.0;
  return spoilt == 0.0;
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

/* The second stage goes on from the solution of the first, where its forces are known. */
static void begin_second_stage(grouser_deck *deck, const grouser_plant *plant, int l, const grouser_tick_start *start) {
  const grouser_body body = {start->row[GROUSER_VX], start->row[GROUSER_VY], start->row[GROUSER_YAW_RATE]};
  const grouser_body anchor =
      grouser_along(body, (1.0 - GROUSER_SDIRK_GAMMA) * plant->step, rates_in(deck, plant, l));
  const grouser_inverse inverse = inverse_in(deck, l);
  deck->anchor[0][l] = anchor.vx;
  deck->anchor[1][l] = anchor.vy;
  deck->anchor[2][l] = anchor.yaw_rate;
  deck->stage[l] = 1;
  deck->iteration[l] = 0;
  const grouser_body residual = residual_in(deck, plant, l, gain_of(plant));
  put_step(deck, l, grouser_direction(&inverse, residual));
  deck->size[l] = grouser_residual_size(residual);
}

/* An extrapolated body is not taken for a solved one: a vehicle near rest would chatter within the tolerance. */
static int is_solved(const grouser_deck *deck, const grouser_plant *plant, int l) {
  const int guessed = deck->iteration[l] == 0 && deck->stage[l] == 0;
  return deck->size[l] <= plant->tolerance && !(guessed && !grouser_same_body(body_in(deck, l), anchor_in(deck, l)));
}

enum grouser_progress grouser_deck_proceed(grouser_deck *deck, const grouser_plant *plant, int l,
                                           const grouser_tick_start *start, grouser_body_step *solution) {
  deck->active[l] = 0;
  if (!is_sound(deck, plant, l)) return GROUSER_STUCK;
  if (plant->integrator == GROUSER_EULER) {
    read_solution(deck, l, start, solution);
    solution->body = grouser_along(solution->body, plant->step, rates_in(deck, plant, l));
    return GROUSER_CONVERGED;
  }
  const int last_stage = plant->integrator == GROUSER_SDIRK2;
  if (is_solved(deck, plant, l) && deck->stage[l] < last_stage) begin_second_stage(deck, plant, l, start);
  if (is_solved(deck, plant, l) && deck->stage[l] == last_stage) {
    read_solution(deck, l, start, solution);
    return GROUSER_CONVERGED;
  }
  if (deck->iteration[l] > 0 && !(deck->size[l] < deck->size_before[l])) return GROUSER_STUCK;
  if (deck->iteration[l] == GROUSER_BROYDEN_LIMIT || !grouser_finite_body(step_in(deck, l))) return GROUSER_STUCK;
  deck->size_before[l] = deck->size[l];
  deck->iteration[l]++;
  deck->iterations[l]++;
  put_body(deck, l, grouser_along(body_in(deck, l), 1.0, step_in(deck, l)));
  deck->active[l] = 1;
  return GROUSER_ITERATES;
}
