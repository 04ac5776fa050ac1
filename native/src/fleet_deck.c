#include "fleet_deck.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "body.h"
#include "lane_loop.h"
#include "lanes.h"

GROUSER_INLINE grouser_body body_in(const grouser_deck *deck, int l) {
  const grouser_body body = {deck->left.column[GROUSER_VX][l], deck->left.column[GROUSER_VY][l],
                             deck->left.column[GROUSER_YAW_RATE][l]};
  return body;
}

GROUSER_INLINE void put_body(grouser_block_rows *rows, int l, grouser_body body) {
  rows->column[GROUSER_VX][l] = body.vx;
  rows->column[GROUSER_VY][l] = body.vy;
  rows->column[GROUSER_YAW_RATE][l] = body.yaw_rate;
}

GROUSER_INLINE grouser_body triple_in(const double (*row)[GROUSER_BLOCK], int l) {
  const grouser_body triple = {row[0][l], row[1][l], row[2][l]};
  return triple;
}

GROUSER_INLINE void put_triple(double (*row)[GROUSER_BLOCK], int l, grouser_body triple) {
  row[0][l] = triple.vx;
  row[1][l] = triple.vy;
  row[2][l] = triple.yaw_rate;
}

GROUSER_INLINE grouser_body anchor_in(const grouser_deck *deck, int l) {
  return triple_in((const double(*)[GROUSER_BLOCK])deck->anchor, l);
}

GROUSER_INLINE grouser_body step_in(const grouser_deck *deck, int l) {
  return triple_in((const double(*)[GROUSER_BLOCK])deck->step, l);
}

GROUSER_INLINE grouser_inverse inverse_in(const grouser_deck *deck, int l) {
  const grouser_inverse inverse = {{{deck->inverse[0][0][l], deck->inverse[0][1][l], deck->inverse[0][2][l]},
                                    {deck->inverse[1][0][l], deck->inverse[1][1][l], deck->inverse[1][2][l]},
                                    {deck->inverse[2][0][l], deck->inverse[2][1][l], deck->inverse[2][2][l]}}};
  return inverse;
}

GROUSER_INLINE void put_inverse(grouser_deck *deck, int l, const grouser_inverse inverse) {
  for (int q = 0; q < 3; q++)
    for (int p = 0; p < 3; p++) deck->inverse[q][p][l] = inverse.entry[q][p];
}

GROUSER_INLINE grouser_inertia inertia_in(const grouser_deck *deck, const grouser_plant *plant, int l) {
  const grouser_inertia inertia = {plant->vehicle.mass, deck->yaw_inertia[l]};
  return inertia;
}

GROUSER_INLINE grouser_body rates_in(const grouser_deck *deck, const grouser_plant *plant, int l) {
  const double force[GROUSER_OUTPUTS] = {deck->forces.force[0][l], deck->forces.force[1][l], deck->forces.force[2][l]};
  return grouser_rates(inertia_in(deck, plant, l), deck->pull[0][l], deck->pull[1][l], body_in(deck, l), force);
}

GROUSER_INLINE grouser_body residual_in(const grouser_deck *deck, const grouser_plant *plant, int l, double gain) {
  return grouser_residual(body_in(deck, l), anchor_in(deck, l), gain, rates_in(deck, plant, l));
}

/* Up to as many, one by one costs less than a whole block. */
enum { FEW_LANES = 4 };

grouser_kernel grouser_deck_kernel(const grouser_kernel *kernel, int ticks) {
  grouser_kernel serving = *kernel;
  if (kernel->evaluate_body && ticks <= FEW_LANES) {
    serving.evaluate_block = NULL;
    serving.prepare_block = NULL;
    serving.prepared_rows = 0;
  }
  return serving;
}

static double gain_of(const grouser_plant *plant) {
  return plant->integrator == GROUSER_SDIRK2 ? GROUSER_SDIRK_GAMMA * plant->step : plant->step;
}

static void level_block(grouser_block_rows *rows, int columns, const double *ratio) {
  const int taken[] = {GROUSER_AX, GROUSER_AY, GROUSER_TERRAIN};
  const int count = columns == grouser_columns(GROUSER_SOIL) ? 3 : 2;
  for (int n = 0; n < count; n++)
    GROUSER_LANE_LOOP
    for (int l = 0; l < GROUSER_BLOCK; l++) rows->column[taken[n]][l] /= ratio[l];
}

void grouser_deck_enter(grouser_deck *deck, const grouser_plant *plant, const grouser_kernel *kernel,
                        const grouser_fleet_block *block, const int64_t *chosen, int home) {
  const int columns = kernel->columns, moves = plant->integrator != GROUSER_EULER;
  const double gain = gain_of(plant), tolerance = plant->tolerance;
  memcpy(deck->left.column, block->row, sizeof block->row[0] * (size_t)columns);
  memcpy(deck->start, block->row, sizeof deck->start);
  memcpy(deck->anchor, block->row, sizeof deck->anchor);
  memcpy(deck->pull, block->pull, sizeof deck->pull);
  memcpy(deck->load_ratio, block->load_ratio, sizeof deck->load_ratio);
  memcpy(deck->yaw_inertia, block->yaw_inertia, sizeof deck->yaw_inertia);
  GROUSER_LANE_LOOP
  for (int l = 0; l < GROUSER_BLOCK; l++) {
    deck->stage[l] = deck->iteration[l] = deck->iterations[l] = 0;
    deck->progress[l] = chosen[l] ? GROUSER_ITERATES : GROUSER_VACANT;
    deck->home[l] = home + l;
  }
  for (int l = 0; moves && l < GROUSER_BLOCK; l++)
    put_body(&deck->left, l,
             grouser_extrapolated(anchor_in(deck, l), block->row[GROUSER_AX][l], block->row[GROUSER_AY][l],
                                  block->yaw_acceleration[l], block->pull[0][l], block->pull[1][l], gain, tolerance));
  if (plant->sampling.tracks) {
    memcpy(deck->right.column, deck->left.column, sizeof deck->left.column[0] * (size_t)GROUSER_TERRAIN);
    memcpy(deck->right.column[GROUSER_TERRAIN], block->theta[1],
           sizeof block->theta[1][0] * (size_t)(columns - GROUSER_TERRAIN));
    level_block(&deck->right, columns, deck->load_ratio);
  }
  level_block(&deck->left, columns, deck->load_ratio);
}

void grouser_deck_move(grouser_deck *from, int lane, grouser_deck *to, int free_lane, const grouser_kernel *kernel,
                       int split) {
  for (int n = 0; n < kernel->columns; n++) {
    to->left.column[n][free_lane] = from->left.column[n][lane];
    if (split) to->right.column[n][free_lane] = from->right.column[n][lane];
  }
  for (int r = 0; r < kernel->prepared_rows; r++) to->prepared[r][free_lane] = from->prepared[r][lane];
  for (int q = 0; q < 3; q++) {
    to->start[q][free_lane] = from->start[q][lane];
    to->anchor[q][free_lane] = from->anchor[q][lane];
    to->step[q][free_lane] = from->step[q][lane];
  }
  for (int q = 0; q < 2; q++) to->pull[q][free_lane] = from->pull[q][lane];
  put_inverse(to, free_lane, inverse_in(from, lane));
  to->load_ratio[free_lane] = from->load_ratio[lane];
  to->yaw_inertia[free_lane] = from->yaw_inertia[lane];
  to->size_before[free_lane] = from->size_before[lane];
  to->stage[free_lane] = from->stage[lane];
  to->iteration[free_lane] = from->iteration[lane];
  to->iterations[free_lane] = from->iterations[lane];
  to->home[free_lane] = from->home[lane];
  to->progress[free_lane] = from->progress[lane];
  from->progress[lane] = GROUSER_VACANT;
}

/* The forces of one lane after another, where the kernel has no block. */
static void evaluate_lanes(grouser_deck *deck, const grouser_kernel *kernel, int split,
                           enum grouser_slopes_wanted wanted) {
  GROUSER_LANE_LOOP
  for (int l = 0; l < GROUSER_BLOCK; l++) {
    if (deck->progress[l] == GROUSER_VACANT) continue;
    double left[GROUSER_MAX_COLUMNS], right[GROUSER_MAX_COLUMNS];
    double force[GROUSER_OUTPUTS], slope[GROUSER_OUTPUTS][3];
    for (int n = 0; n < kernel->columns; n++) left[n] = deck->left.column[n][l];
    for (int n = 0; split && n < kernel->columns; n++) right[n] = deck->right.column[n][l];
    grouser_kernel_forces(kernel, left, split ? right : NULL, wanted, force, slope);
    for (int n = 0; n < GROUSER_OUTPUTS; n++) {
      deck->forces.force[n][l] = force[n];
      for (int q = 0; wanted && q < 3; q++) deck->forces.slope[n][q][l] = slope[n][q];
    }
  }
}

/* Forces under the load of each lane. */
static void evaluate_deck(grouser_deck *deck, const grouser_plant *plant, const grouser_kernel *kernel,
                          enum grouser_slopes_wanted wanted) {
  const grouser_block_rows *right = plant->sampling.tracks ? &deck->right : &deck->left;
  int busy = 0;
  GROUSER_LANE_LOOP
  for (int l = 0; l < GROUSER_BLOCK; l++) busy += deck->progress[l] != GROUSER_VACANT;
  if (kernel->evaluate_block && !(kernel->evaluate_body && busy <= FEW_LANES))
    kernel->evaluate_block(kernel->self, &deck->left, right, (const double(*)[GROUSER_BLOCK])deck->prepared, wanted,
                           &deck->forces);
  else
    evaluate_lanes(deck, kernel, plant->sampling.tracks, wanted);
  for (int n = 0; n < GROUSER_OUTPUTS; n++)
    GROUSER_LANE_LOOP
    for (int l = 0; l < GROUSER_BLOCK; l++) deck->forces.force[n][l] *= deck->load_ratio[l];
}

/* What comes of a tick whose forces are known; `spoilt` is 0 where they and their slopes are finite. An extrapolated
 * body is not taken for a solved one: a vehicle near rest would chatter within the tolerance. */
GROUSER_INLINE int64_t judged(const grouser_deck *deck, const grouser_plant *plant, int l, double spoilt) {
  const int64_t guessed = (deck->iteration[l] == 0) & (deck->stage[l] == 0);
  const int64_t still = grouser_same_body(body_in(deck, l), anchor_in(deck, l));
  const int64_t solved = (deck->size[l] <= plant->tolerance) & (still | !guessed);
  const int64_t shrinks = (deck->iteration[l] == 0) | (deck->size[l] < deck->size_before[l]);
  const int64_t good = shrinks & (deck->iteration[l] < GROUSER_BROYDEN_LIMIT) & grouser_finite_body(step_in(deck, l));
  const int64_t sound = spoilt == 0.0, busy = deck->progress[l] != GROUSER_VACANT;
  /* From stuck, the last of the enumeration, back to converged and to what iterates. */
  return (GROUSER_STUCK - (sound & solved) - ((sound & good & ~solved) << 1)) & -busy;
}

/* From the slopes under the load of the lane. */
GROUSER_INLINE grouser_inverse inverted(const grouser_deck *deck, const grouser_plant *plant, int l, double gain) {
  const double ratio = deck->load_ratio[l];
  const grouser_block_forces *f = &deck->forces;
  const double slope[GROUSER_OUTPUTS][3] = {
      {ratio * f->slope[0][0][l], ratio * f->slope[0][1][l], ratio * f->slope[0][2][l]},
      {ratio * f->slope[1][0][l], ratio * f->slope[1][1][l], ratio * f->slope[1][2][l]},
      {ratio * f->slope[2][0][l], ratio * f->slope[2][1][l], ratio * f->slope[2][2][l]}};
  return grouser_invert(inertia_in(deck, plant, l), body_in(deck, l), slope, gain);
}

/* The second stage goes on from the solution of the first, where its forces are known. */
static void begin_second_stage(grouser_deck *deck, const grouser_plant *plant, int l) {
  const double gain = gain_of(plant), rest = (1.0 - GROUSER_SDIRK_GAMMA) * plant->step;
  const grouser_inverse inverse = inverse_in(deck, l);
  const grouser_body start = triple_in((const double(*)[GROUSER_BLOCK])deck->start, l);
  put_triple(deck->anchor, l, grouser_along(start, rest, rates_in(deck, plant, l)));
  deck->stage[l] = 1;
  deck->iteration[l] = 0;
  const grouser_body residual = residual_in(deck, plant, l, gain);
  put_triple(deck->step, l, grouser_direction(&inverse, residual));
  deck->size[l] = grouser_residual_size(residual);
  deck->progress[l] = judged(deck, plant, l, 0.0);
}

/* Judges every lane, and takes the step of those that go on. */
static void proceed(grouser_deck *deck, const grouser_plant *plant, const double *spoilt) {
  GROUSER_LANE_LOOP
  for (int l = 0; l < GROUSER_BLOCK; l++) deck->progress[l] = judged(deck, plant, l, spoilt[l]);
  for (int l = 0; plant->integrator == GROUSER_SDIRK2 && l < GROUSER_BLOCK; l++)
    if (deck->progress[l] == GROUSER_CONVERGED && deck->stage[l] == 0) begin_second_stage(deck, plant, l);
  GROUSER_LANE_LOOP
  for (int l = 0; l < GROUSER_BLOCK; l++) {
    const int64_t goes_on = deck->progress[l] == GROUSER_ITERATES;
    const grouser_body body = body_in(deck, l), next = grouser_along(body, 1.0, step_in(deck, l));
    deck->size_before[l] = deck->size[l];
    deck->iteration[l] += goes_on;
    deck->iterations[l] += goes_on;
    deck->left.column[GROUSER_VX][l] = goes_on ? next.vx : body.vx;
    deck->left.column[GROUSER_VY][l] = goes_on ? next.vy : body.vy;
    deck->left.column[GROUSER_YAW_RATE][l] = goes_on ? next.yaw_rate : body.yaw_rate;
  }
  if (plant->sampling.tracks) memcpy(deck->right.column, deck->left.column, sizeof deck->left.column[0] * 3);
}

void grouser_deck_open(grouser_deck *deck, const grouser_plant *plant, const grouser_kernel *kernel) {
  const double gain = gain_of(plant);
  /* An explicit step goes without slopes, save that a primary whose slopes are not finite has failed. */
  const int euler = plant->integrator == GROUSER_EULER, want_slopes = !euler || plant->guard;
  const grouser_block_rows *right = plant->sampling.tracks ? &deck->right : &deck->left;
  double spoilt[GROUSER_BLOCK];
  if (kernel->prepare_block) kernel->prepare_block(kernel->self, &deck->left, right, deck->prepared);
  evaluate_deck(deck, plant, kernel, want_slopes ? GROUSER_LEADING_SLOPES : GROUSER_NO_SLOPES);
  GROUSER_LANE_LOOP
  for (int l = 0; l < GROUSER_BLOCK; l++) {
    const grouser_body residual = residual_in(deck, plant, l, gain);
    deck->size[l] = grouser_residual_size(residual);
    spoilt[l] = deck->size[l] * 0.0;
  }
  for (int n = 0; want_slopes && n < GROUSER_OUTPUTS; n++)
    for (int q = 0; q < 3; q++)
      GROUSER_LANE_LOOP
      for (int l = 0; l < GROUSER_BLOCK; l++) spoilt[l] += deck->forces.slope[n][q][l] * 0.0;
  if (euler) {
    GROUSER_LANE_LOOP
    for (int l = 0; l < GROUSER_BLOCK; l++)
      if (deck->progress[l] != GROUSER_VACANT) deck->progress[l] = spoilt[l] == 0.0 ? GROUSER_CONVERGED : GROUSER_STUCK;
    return;
  }
  GROUSER_LANE_LOOP
  for (int l = 0; l < GROUSER_BLOCK; l++) put_inverse(deck, l, inverted(deck, plant, l, gain));
  GROUSER_LANE_LOOP
  for (int l = 0; l < GROUSER_BLOCK; l++) {
    const grouser_inverse inverse = inverse_in(deck, l);
    put_triple(deck->step, l, grouser_direction(&inverse, residual_in(deck, plant, l, gain)));
  }
  proceed(deck, plant, spoilt);
}

void grouser_deck_follow(grouser_deck *deck, const grouser_plant *plant, const grouser_kernel *kernel) {
  const double gain = gain_of(plant);
  double spoilt[GROUSER_BLOCK];
  evaluate_deck(deck, plant, kernel, GROUSER_NO_SLOPES);
  GROUSER_LANE_LOOP
  for (int l = 0; l < GROUSER_BLOCK; l++) {
    grouser_inverse inverse = inverse_in(deck, l);
    const grouser_body residual = residual_in(deck, plant, l, gain);
    put_triple(deck->step, l, grouser_broyden_step(&inverse, step_in(deck, l), residual));
    put_inverse(deck, l, inverse);
    deck->size[l] = grouser_residual_size(residual);
    spoilt[l] = deck->size[l] * 0.0;
  }
  proceed(deck, plant, spoilt);
}

void grouser_deck_read(const grouser_deck *deck, const grouser_plant *plant, int l, grouser_block_solution *solution,
                       int to) {
  const grouser_body received = body_in(deck, l);
  const grouser_body body = plant->integrator == GROUSER_EULER
                                ? grouser_along(received, plant->step, rates_in(deck, plant, l))
                                : received;
  put_triple(solution->received, to, received);
  put_triple(solution->body, to, body);
  for (int n = 0; n < GROUSER_OUTPUTS; n++) solution->force[n][to] = deck->forces.force[n][l];
  solution->iterations[to] = (double)deck->iterations[l];
  solution->divisions[to] = 1.0;
}
