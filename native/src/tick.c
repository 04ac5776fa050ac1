#include "grouser/tick.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "motion.h"
#include "tick_parts.h"

void grouser_plant_init(grouser_plant *plant, const grouser_vehicle *vehicle, const grouser_kernel *kernel,
                        const grouser_guard *guard, int tracks, enum grouser_integrator integrator, double step,
                        double tolerance) {
  memset(plant, 0, sizeof *plant);
  plant->vehicle = *vehicle;
  plant->kernel = kernel;
  plant->guard = guard;
  plant->sampling.gravity = vehicle->gravity;
  plant->sampling.contact_center = vehicle->contact_center;
  plant->sampling.tread = vehicle->tread;
  plant->sampling.tracks = tracks;
  plant->integrator = integrator;
  plant->step = step;
  plant->tolerance = tolerance;
  plant->traits =
      grouser_traits_of(vehicle->yaw_inertia, vehicle->belt_time_constant, vehicle->belt_acceleration, step);
}

grouser_traits grouser_traits_of(double yaw_inertia, double belt_time_constant, double belt_acceleration, double step) {
  const grouser_traits traits = {yaw_inertia, belt_time_constant, belt_acceleration, exp(-step / belt_time_constant),
                                 exp(-(step / 2) / belt_time_constant)};
  return traits;
}

grouser_vehicle_state grouser_vehicle_at_rest(void) {
  grouser_vehicle_state state;
  memset(&state, 0, sizeof state);
  state.guard = grouser_guard_fresh();
  return state;
}

static int finite_state(const grouser_vehicle_state *state) {
  return isfinite(state->x + state->y + state->heading + state->vx + state->vy + state->yaw_rate + state->v_left +
                  state->v_right + state->ax + state->ay + state->time);
}

enum grouser_status grouser_tick_begin(const grouser_plant *plant, const grouser_ground *ground,
                                       const double command[2], const grouser_vehicle_state *state,
                                       grouser_tick_start *start) {
  const grouser_traits *traits = start->traits;
  const int columns = plant->kernel->columns;
  const double belts[2] = {state->v_left, state->v_right};
  if (!finite_state(state) || !isfinite(command[0]) || !isfinite(command[1])) return GROUSER_DIVERGED;
  if (!grouser_sample_ground(ground, &plant->sampling, state->x, state->y, start->cosine, start->sine,
                             &start->footing))
    return GROUSER_OFF_MAP;
  start->row[GROUSER_VX] = state->vx;
  start->row[GROUSER_VY] = state->vy;
  start->row[GROUSER_YAW_RATE] = state->yaw_rate;
  start->row[GROUSER_AX] = state->ax;
  start->row[GROUSER_AY] = state->ay;
  for (int side = 0; side < 2; side++) {
    start->belts[side] = grouser_belt_after(traits, belts[side], command[side], plant->step, traits->decay);
    start->row[GROUSER_V_LEFT + side] =
        plant->integrator == GROUSER_EULER
            ? belts[side]
            : grouser_belt_after(traits, belts[side], command[side], plant->step / 2, traits->half_decay);
  }
  /* A body on slipping tracks turns by about half of what its belts do: over a tick, by as much as they do in its second
   * half. */
  start->yaw_acceleration = ((start->belts[1] - start->row[GROUSER_V_RIGHT]) -
                             (start->belts[0] - start->row[GROUSER_V_LEFT])) /
                            (plant->vehicle.tread * plant->step);
  for (int p = 0; p < columns - GROUSER_TERRAIN; p++) start->row[GROUSER_TERRAIN + p] = start->footing.theta[0][p];
  start->guard = state->guard;
  if (plant->guard) {
    double level[GROUSER_MAX_COLUMNS];
    grouser_level_row(start->row, columns, &start->footing, 0, level);
    start->detection = grouser_detect(&plant->guard->detector, level);
    start->guard = grouser_guard_advance(&plant->guard->policy, &state->guard, &start->detection, plant->step);
  }
  return GROUSER_SOLVED;
}

static int solve(const grouser_plant *plant, const grouser_tick_start *start, grouser_dynamics *dynamics,
                 grouser_body_step *step) {
  if (plant->integrator == GROUSER_EULER) {
    grouser_explicit_step(dynamics, start->row, plant->step, step);
    return 1;
  }
  return grouser_implicit_step(dynamics, start->row, plant->step, plant->tolerance, plant->integrator, step);
}

enum grouser_status grouser_tick_solve(const grouser_plant *plant, grouser_tick_start *start,
                                       const grouser_vehicle_state *state, grouser_body_step *step) {
  grouser_dynamics dynamics = {
      {plant->vehicle.mass, start->traits->yaw_inertia},
      plant->vehicle.tread,
      &start->footing,
      start->yaw_acceleration,
      {plant->kernel, plant->guard ? plant->guard->fallback : NULL, start->guard.fallback_weight, 0}};
  int solved = solve(plant, start, &dynamics, step);
  if (dynamics.blend.primary_failed) {
    /* The mode is frozen within a tick: the whole of it goes to the fallback. */
    const grouser_detection failure = {INFINITY, GROUSER_FINITE, GROUSER_PRIMARY_OUTPUT};
    start->detection = failure;
    start->guard = grouser_guard_advance(&plant->guard->policy, &state->guard, &failure, plant->step);
    dynamics.blend.fallback_weight = start->guard.fallback_weight;
    solved = solve(plant, start, &dynamics, step);
  }
  return solved ? GROUSER_SOLVED : GROUSER_DIVERGED;
}

enum grouser_status grouser_tick_finish(const grouser_plant *plant, grouser_tick_start *start, grouser_body body,
                                        const double force[GROUSER_OUTPUTS], grouser_vehicle_state *state) {
  const double half = plant->step / 2, c0 = start->cosine, s0 = start->sine;
  grouser_vehicle_state end = *state;
  end.heading = state->heading + half * (state->yaw_rate + body.yaw_rate);
  const grouser_turn turn = grouser_turn_of(end.heading);
  const double c1 = turn.cosine, s1 = turn.sine;
  end.x = state->x + half * (c0 * state->vx - s0 * state->vy + c1 * body.vx - s1 * body.vy);
  end.y = state->y + half * (s0 * state->vx + c0 * state->vy + s1 * body.vx + c1 * body.vy);
  end.vx = body.vx;
  end.vy = body.vy;
  end.yaw_rate = body.yaw_rate;
  end.v_left = start->belts[0];
  end.v_right = start->belts[1];
  end.ax = force[0] / plant->vehicle.mass;
  end.ay = force[1] / plant->vehicle.mass;
  end.time = state->time + plant->step;
  end.guard = start->guard;
  if (!finite_state(&end)) return GROUSER_DIVERGED;
  *state = end;
  start->cosine = c1;
  start->sine = s1;
  return GROUSER_SOLVED;
}

enum grouser_status grouser_tick(const grouser_plant *plant, const grouser_ground *ground, const double command[2],
                                 grouser_vehicle_state *state, grouser_tick_record *record) {
  grouser_tick_start start;
  grouser_body_step step;
  memset(&start, 0, sizeof start);
  start.traits = &plant->traits;
  const grouser_turn turn = grouser_turn_of(state->heading);
  start.cosine = turn.cosine;
  start.sine = turn.sine;
  enum grouser_status status = grouser_tick_begin(plant, ground, command, state, &start);
  if (status == GROUSER_SOLVED) status = grouser_tick_solve(plant, &start, state, &step);
  if (status == GROUSER_SOLVED) status = grouser_tick_finish(plant, &start, step.body, step.force, state);
  if (status != GROUSER_SOLVED) return status;
  memcpy(record->row, step.row, sizeof record->row);
  memcpy(record->force, step.force, sizeof record->force);
  record->iterations = step.iterations;
  record->divisions = step.divisions;
  record->detection = start.detection;
  return GROUSER_SOLVED;
}
