#include "grouser/episodes.h"

#include <math.h>
#include <string.h>

#include "grouser/slip_power.h"
#include "threads.h"

static double state_of(const grouser_fleet *fleet, int row, int vehicle) {
  return fleet->state[(size_t)row * (size_t)fleet->vehicles + (size_t)vehicle];
}

static void *memory_of(const grouser_episodes *e, int vehicle) {
  return (unsigned char *)e->memory + e->rules->memory * (size_t)vehicle;
}

static double time_of(const grouser_episodes *e, int vehicle) {
  return e->periods[vehicle] * e->task->control_period;
}

static grouser_sight sight_of(const grouser_episodes *e, int vehicle) {
  const grouser_fleet *fleet = e->fleet;
  grouser_sight sight = {.x = state_of(fleet, GROUSER_STATE_X, vehicle),
                         .y = state_of(fleet, GROUSER_STATE_Y, vehicle),
                         .heading = state_of(fleet, GROUSER_STATE_HEADING, vehicle),
                         .vx = state_of(fleet, GROUSER_STATE_VX, vehicle),
                         .vy = state_of(fleet, GROUSER_STATE_VY, vehicle),
                         .yaw_rate = state_of(fleet, GROUSER_STATE_YAW_RATE, vehicle),
                         .v_left = state_of(fleet, GROUSER_STATE_V_LEFT, vehicle),
                         .v_right = state_of(fleet, GROUSER_STATE_V_RIGHT, vehicle)};
  if (e->task->parameters == 0) return sight;
  const grouser_ground *ground = &fleet->grounds[vehicle];
  double *seen = e->parameters + (size_t)vehicle * GROUSER_MAX_PARAMETERS, theta[GROUSER_MAX_PARAMETERS];
  /* Off the map the vehicle sees what it saw last. */
  if (!ground->field)
    memcpy(seen, ground->theta[0], sizeof theta);
  else if (grouser_field_at(ground->field, sight.x, sight.y, theta, NULL))
    memcpy(seen, theta, sizeof(double) * (size_t)ground->parameters);
  memcpy(sight.parameters, seen, sizeof sight.parameters);
  return sight;
}

static void look(const grouser_episodes *e, int vehicle, const grouser_sight *sight) {
  float *observation = e->observations + (size_t)vehicle * (size_t)grouser_task_observation_size(e->task);
  const double time = time_of(e, vehicle);
  grouser_task_observe(e->task, sight, e->previous + 2 * (size_t)vehicle, observation);
  e->rules->observe(e->rules->self, memory_of(e, vehicle), time, e->task, sight, observation + GROUSER_SEEN_MOTION);
  e->rules->measure(e->rules->self, memory_of(e, vehicle), time, sight,
                    e->measures + GROUSER_TASK_MEASURES * (size_t)vehicle);
}

/* Slip power of the last tick, in W, on the ground where it began. */
static double slip_power(const grouser_episodes *e, int vehicle) {
  const grouser_fleet *fleet = e->fleet;
  const double *pose = e->poses + 3 * (size_t)vehicle;
  double left[GROUSER_MAX_COLUMNS], right[GROUSER_MAX_COLUMNS];
  const int columns = e->slip_block->columns;
  for (int n = 0; n < columns; n++)
    left[n] = fleet->record[(size_t)(GROUSER_RECORD_ROW + n) * (size_t)fleet->vehicles + (size_t)vehicle];
  memcpy(right, left, sizeof(double) * (size_t)columns);
  grouser_footing footing;
  if (!grouser_sample_ground(&fleet->grounds[vehicle], &fleet->plant->sampling, pose[0], pose[1], cos(pose[2]),
                             sin(pose[2]), &footing))
    return NAN;
  if (footing.split)
    memcpy(right + GROUSER_TERRAIN, footing.theta[1], sizeof(double) * (size_t)(columns - GROUSER_TERRAIN));
  return grouser_slip_power(e->slip_block, left, right, footing.load_ratio);
}

static void assess(const grouser_episodes *e, int vehicle) {
  const double *action = e->actions + 2 * (size_t)vehicle;
  double *previous = e->previous + 2 * (size_t)vehicle, *terms = e->terms + GROUSER_TASK_TERMS * (size_t)vehicle;
  const grouser_sight sight = sight_of(e, vehicle);
  void *memory = memory_of(e, vehicle);
  e->periods[vehicle] += 1.0;
  if (e->fleet->status[vehicle] != GROUSER_SOLVED) {
    /* The episode ends where the last solved tick left the vehicle: one bad episode must not end a training. */
    e->rules->follow(e->rules->self, memory, &sight);
    memset(terms, 0, sizeof(double) * GROUSER_TASK_TERMS);
    e->rewards[vehicle] = e->task->broken_off_reward;
    e->terminated[vehicle] = 1;
    e->truncated[vehicle] = 0;
  } else {
    const int ended = e->rules->assess(e->rules->self, memory, time_of(e, vehicle), &sight, terms);
    grouser_task_costs(e->task, action, previous, slip_power(e, vehicle), terms + 2);
    double reward = 0.0;
    for (int term = 0; term < GROUSER_TASK_TERMS; term++) reward += terms[term];
    e->rewards[vehicle] = reward;
    e->terminated[vehicle] = ended != 0;
    e->truncated[vehicle] = !ended && e->periods[vehicle] >= (double)e->task->steps;
  }
  memcpy(previous, action, 2 * sizeof(double));
  look(e, vehicle, &sight);
}

/* Whether the ground under a vehicle depends on where it is or heads. */
static int ground_varies(const grouser_episodes *e, int first, int end) {
  for (int vehicle = first; vehicle < end; vehicle++) {
    const grouser_ground *ground = &e->fleet->grounds[vehicle];
    if (ground->field || ground->slope_x != 0.0 || ground->slope_y != 0.0) return 1;
  }
  return 0;
}

static void step_range(const grouser_episodes *e, int first, int end) {
  const grouser_fleet *fleet = e->fleet;
  for (int vehicle = first; vehicle < end; vehicle++) {
    grouser_task_command(e->task, e->actions + 2 * (size_t)vehicle, e->commands + 2 * (size_t)vehicle);
    /* A fleet leaves alone what it did not solve: that is how a vehicle sits out. */
    if (e->idle[vehicle]) fleet->status[vehicle] = GROUSER_DIVERGED;
  }
  /* Where the last tick began matters to the slip power only on ground that varies; a fleet is faster undivided. */
  const int last_ticks = ground_varies(e, first, end) ? 1 : e->ticks;
  if (last_ticks < e->ticks) fleet->advance_lanes(fleet, e->commands, e->ticks - last_ticks, first, end);
  for (int vehicle = first; vehicle < end; vehicle++) {
    double *pose = e->poses + 3 * (size_t)vehicle;
    pose[0] = state_of(fleet, GROUSER_STATE_X, vehicle);
    pose[1] = state_of(fleet, GROUSER_STATE_Y, vehicle);
    pose[2] = state_of(fleet, GROUSER_STATE_HEADING, vehicle);
  }
  fleet->advance_lanes(fleet, e->commands, last_ticks, first, end);
  for (int vehicle = first; vehicle < end; vehicle++) {
    if (!e->idle[vehicle]) {
      assess(e, vehicle);
      continue;
    }
    fleet->status[vehicle] = GROUSER_SOLVED;
    e->rewards[vehicle] = 0.0;
    e->terminated[vehicle] = e->truncated[vehicle] = 0;
  }
}

static void step_share(void *work, int part, int parts) {
  const grouser_episodes *e = (const grouser_episodes *)work;
  const grouser_range range = grouser_share_of(e->fleet->vehicles, part, parts);
  step_range(e, range.first, range.end);
}

void grouser_episodes_step(const grouser_episodes *episodes, struct grouser_pool *pool) {
  void *work = (void *)(uintptr_t)episodes;
  if (pool)
    grouser_pool_run(pool, step_share, grouser_pool_parts(pool, grouser_fleet_blocks(episodes->fleet->vehicles)), work);
  else
    step_share(work, 0, 1);
}

void grouser_episodes_begin(const grouser_episodes *e, int vehicle) {
  e->periods[vehicle] = 0.0;
  e->previous[2 * (size_t)vehicle] = e->previous[2 * (size_t)vehicle + 1] = 0.0;
  const grouser_sight sight = sight_of(e, vehicle);
  look(e, vehicle, &sight);
}
