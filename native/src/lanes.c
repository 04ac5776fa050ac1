/* Vehicles in lanes: the forces of GROUSER_BLOCK vehicles are evaluated at once, and each lane goes its own way between
 * two evaluations. A lane whose Newton has converged begins the next tick, and then the next vehicle, while the others
 * iterate; one that needs a shorter step, another guess or the fallback is finished on its own. Every decision looks at
 * its own lane alone, so that a vehicle's bits do not depend on its neighbours. */
#include "lanes.h"

#include <math.h>
#include <string.h>

#include "cpu.h"
#include "tick_parts.h"

typedef struct {
  int vehicle; /* or -1 */
  int ticks;   /* that are left */
  int stage, iteration, iterations;
  int solved; /* whether a record was made */
  double size; /* of the residual that this step started from */
  grouser_vehicle_state state;
  grouser_tick_start start;
  grouser_tick_record record;
} lane;

typedef struct {
  const grouser_fleet *fleet;
  const double *commands;
  int ticks, next, end; /* vehicles that no lane has taken yet */
  double gain;
  lane lanes[GROUSER_BLOCK];
  grouser_block_rows left, right;
  grouser_block_forces forces;
  double anchor[3][GROUSER_BLOCK], pull[2][GROUSER_BLOCK], load_ratio[GROUSER_BLOCK];
  double size[GROUSER_BLOCK], direction[3][GROUSER_BLOCK], spoilt[GROUSER_BLOCK];
} lanes;

static void put_row(grouser_block_rows *rows, int columns, int l, const double *row) {
  for (int n = 0; n < columns; n++) rows->column[n][l] = row[n];
}

static grouser_body body_in(const lanes *w, int l) {
  const grouser_body body = {w->left.column[GROUSER_VX][l], w->left.column[GROUSER_VY][l],
                             w->left.column[GROUSER_YAW_RATE][l]};
  return body;
}

static void put_body(lanes *w, int l, grouser_body body) {
  w->left.column[GROUSER_VX][l] = w->right.column[GROUSER_VX][l] = body.vx;
  w->left.column[GROUSER_VY][l] = w->right.column[GROUSER_VY][l] = body.vy;
  w->left.column[GROUSER_YAW_RATE][l] = w->right.column[GROUSER_YAW_RATE][l] = body.yaw_rate;
}

static void begin_stage(lanes *w, int l, grouser_body anchor, int stage) {
  w->anchor[0][l] = anchor.vx;
  w->anchor[1][l] = anchor.vy;
  w->anchor[2][l] = anchor.yaw_rate;
  w->lanes[l].stage = stage;
  w->lanes[l].iteration = 0;
}

/* Puts the tick that has begun into the block. */
static void enter_block(lanes *w, int l) {
  const grouser_plant *plant = w->fleet->plant;
  lane *own = &w->lanes[l];
  const int columns = plant->kernel->columns;
  double level[GROUSER_MAX_COLUMNS];
  grouser_level_row(own->start.row, columns, &own->start.footing, 0, level);
  put_row(&w->left, columns, l, level);
  if (own->start.footing.split) {
    grouser_level_row(own->start.row, columns, &own->start.footing, 1, level);
    put_row(&w->right, columns, l, level);
  }
  w->pull[0][l] = own->start.footing.pull_x;
  w->pull[1][l] = own->start.footing.pull_y;
  w->load_ratio[l] = own->start.footing.load_ratio;
  own->iterations = 0;
  begin_stage(w, l, body_in(w, l), 0);
}

static enum grouser_status finish_tick(lanes *w, int l, const grouser_body_step *step) {
  lane *own = &w->lanes[l];
  const enum grouser_status status =
      grouser_tick_finish(w->fleet->plant, &own->start, step->body, step->force, &own->state);
  if (status != GROUSER_SOLVED) return status;
  own->ticks--;
  own->solved = 1;
  memcpy(own->record.row, step->row, sizeof step->row);
  memcpy(own->record.force, step->force, sizeof step->force);
  own->record.iterations = step->iterations;
  own->record.divisions = step->divisions;
  own->record.detection = own->start.detection;
  return status;
}

static enum grouser_status finish_alone(lanes *w, int l) {
  lane *own = &w->lanes[l];
  grouser_body_step step;
  const enum grouser_status status = grouser_tick_solve(w->fleet->plant, &own->start, &own->state, &step);
  return status == GROUSER_SOLVED ? finish_tick(w, l, &step) : status;
}

/* Begins ticks until one belongs into the block; 0 when the vehicle has none left, or is lost. */
static int next_tick(lanes *w, int l, enum grouser_status status) {
  const grouser_fleet *fleet = w->fleet;
  lane *own = &w->lanes[l];
  while (status == GROUSER_SOLVED && own->ticks > 0) {
    status = grouser_tick_begin(fleet->plant, &fleet->grounds[own->vehicle], w->commands + 2 * own->vehicle,
                                &own->state, &own->start);
    if (status != GROUSER_SOLVED) break;
    /* The block evaluates one kernel for all: what the fallback has a share in goes alone. */
    if (!fleet->plant->guard || own->start.guard.fallback_weight <= 0.0) {
      enter_block(w, l);
      return 1;
    }
    status = finish_alone(w, l);
  }
  if (own->solved) grouser_fleet_store(fleet, own->vehicle, &own->state, &own->record);
  fleet->status[own->vehicle] = (unsigned char)status;
  return 0;
}

/* Gives the lane the next vehicle that has a tick for the block; 0 if there is none. */
static int take_vehicle(lanes *w, int l) {
  lane *own = &w->lanes[l];
  while (w->next < w->end) {
    own->vehicle = w->next++;
    if (w->fleet->status[own->vehicle] != GROUSER_SOLVED) continue;
    own->ticks = w->ticks;
    own->solved = 0;
    grouser_fleet_load(w->fleet, own->vehicle, &own->state);
    own->start.cosine = cos(own->state.heading);
    own->start.sine = sin(own->state.heading);
    if (next_tick(w, l, GROUSER_SOLVED)) return 1;
  }
  own->vehicle = -1;
  return 0;
}

static void evaluate_lanes(lanes *w) {
  const grouser_kernel *kernel = w->fleet->plant->kernel;
  const int split = w->fleet->plant->sampling.tracks;
  if (kernel->evaluate_block) {
    kernel->evaluate_block(kernel->self, &w->left, split ? &w->right : &w->left, &w->forces);
    return;
  }
  for (int l = 0; l < GROUSER_BLOCK; l++) {
    if (w->lanes[l].vehicle < 0) continue;
    double left[GROUSER_MAX_COLUMNS], right[GROUSER_MAX_COLUMNS];
    double force[GROUSER_OUTPUTS], slope[GROUSER_OUTPUTS][3];
    for (int n = 0; n < kernel->columns; n++) {
      left[n] = w->left.column[n][l];
      right[n] = w->right.column[n][l];
    }
    grouser_kernel_forces(kernel, left, split ? right : NULL, force, slope);
    for (int n = 0; n < GROUSER_OUTPUTS; n++) {
      w->forces.force[n][l] = force[n];
      for (int q = 0; q < 3; q++) w->forces.slope[n][q][l] = slope[n][q];
    }
  }
}

/* Residual and Newton direction of every lane, and the forces under its load. */
GROUSER_CLONES
static void newton(const grouser_vehicle *vehicle, double gain, lanes *w) {
  for (int l = 0; l < GROUSER_BLOCK; l++) {
    const double ratio = w->load_ratio[l];
    const grouser_body body = {w->left.column[GROUSER_VX][l], w->left.column[GROUSER_VY][l],
                               w->left.column[GROUSER_YAW_RATE][l]};
    const grouser_body anchor = {w->anchor[0][l], w->anchor[1][l], w->anchor[2][l]};
    const double force[GROUSER_OUTPUTS] = {ratio * w->forces.force[0][l], ratio * w->forces.force[1][l],
                                           ratio * w->forces.force[2][l]};
    const double slope[GROUSER_OUTPUTS][3] = {
        {ratio * w->forces.slope[0][0][l], ratio * w->forces.slope[0][1][l], ratio * w->forces.slope[0][2][l]},
        {ratio * w->forces.slope[1][0][l], ratio * w->forces.slope[1][1][l], ratio * w->forces.slope[1][2][l]},
        {ratio * w->forces.slope[2][0][l], ratio * w->forces.slope[2][1][l], ratio * w->forces.slope[2][2][l]}};
    const grouser_body rates = grouser_rates(vehicle, w->pull[0][l], w->pull[1][l], body, force);
    const grouser_body residual = grouser_residual(body, anchor, gain, rates);
    const grouser_body direction = grouser_newton_direction(vehicle, body, slope, residual, gain);
    const double sum = slope[0][0] + slope[0][1] + slope[0][2] + slope[1][0] + slope[1][1] + slope[1][2] +
                       slope[2][0] + slope[2][1] + slope[2][2];
    w->spoilt[l] = sum * 0.0; /* NaN where a slope is not finite */
    w->size[l] = grouser_residual_size(residual);
    w->direction[0][l] = direction.vx;
    w->direction[1][l] = direction.vy;
    w->direction[2][l] = direction.yaw_rate;
    for (int n = 0; n < GROUSER_OUTPUTS; n++) w->forces.force[n][l] = force[n];
  }
}

/* The lane's step as it stands, with the forces of this evaluation. */
static void read_step(const lanes *w, int l, grouser_body_step *step) {
  const lane *own = &w->lanes[l];
  step->body = body_in(w, l);
  memcpy(step->row, own->start.row, sizeof step->row);
  step->row[GROUSER_VX] = step->body.vx;
  step->row[GROUSER_VY] = step->body.vy;
  step->row[GROUSER_YAW_RATE] = step->body.yaw_rate;
  for (int n = 0; n < GROUSER_OUTPUTS; n++) step->force[n] = w->forces.force[n][l];
  step->iterations = own->iterations;
  step->divisions = 1;
}

static grouser_body rates_in(const lanes *w, int l, const grouser_body_step *step) {
  return grouser_rates(&w->fleet->plant->vehicle, w->pull[0][l], w->pull[1][l], step->body, step->force);
}

/* What one evaluation means for a lane: another Newton step, another stage, or the end of the tick; 0 when its vehicle
 * is done. */
static int proceed(lanes *w, int l) {
  const grouser_plant *plant = w->fleet->plant;
  lane *own = &w->lanes[l];
  const double size = w->size[l];
  grouser_body_step step;
  if (plant->integrator == GROUSER_EULER) {
    if (!(isfinite(size) && isfinite(w->spoilt[l]))) return next_tick(w, l, finish_alone(w, l));
    read_step(w, l, &step);
    step.body = grouser_along(step.body, plant->step, rates_in(w, l, &step));
    return next_tick(w, l, finish_tick(w, l, &step));
  }
  const int sound = isfinite(size) && isfinite(w->spoilt[l]) && (own->iteration == 0 || size < own->size);
  if (sound && size <= plant->tolerance) {
    own->iterations += own->iteration;
    read_step(w, l, &step);
    if (plant->integrator != GROUSER_SDIRK2 || own->stage > 0) return next_tick(w, l, finish_tick(w, l, &step));
    const grouser_body start = {own->state.vx, own->state.vy, own->state.yaw_rate};
    begin_stage(w, l, grouser_along(start, (1.0 - GROUSER_SDIRK_GAMMA) * plant->step, rates_in(w, l, &step)), 1);
    return 1;
  }
  const grouser_body direction = {w->direction[0][l], w->direction[1][l], w->direction[2][l]};
  if (!sound || own->iteration == GROUSER_NEWTON_LIMIT || !grouser_finite_body(direction))
    return next_tick(w, l, finish_alone(w, l));
  own->size = size;
  own->iteration++;
  put_body(w, l, grouser_along(body_in(w, l), 1.0, direction));
  return 1;
}

void grouser_fleet_advance_range(const grouser_fleet *fleet, const double *commands, int ticks, int first, int end) {
  const grouser_plant *plant = fleet->plant;
  lanes w;
  int busy = 0;
  memset(&w, 0, sizeof w);
  w.fleet = fleet;
  w.commands = commands;
  w.ticks = ticks;
  w.next = first;
  w.end = end;
  w.gain = plant->integrator == GROUSER_SDIRK2 ? GROUSER_SDIRK_GAMMA * plant->step : plant->step;
  for (int l = 0; l < GROUSER_BLOCK; l++) busy += take_vehicle(&w, l);
  while (busy > 0) {
    evaluate_lanes(&w);
    newton(&plant->vehicle, w.gain, &w);
    for (int l = 0; l < GROUSER_BLOCK; l++)
      if (w.lanes[l].vehicle >= 0 && !proceed(&w, l)) busy -= !take_vehicle(&w, l);
  }
}
