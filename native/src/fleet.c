#include "grouser/fleet.h"

#include <math.h>
#include <stddef.h>

#include "fleet_lanes.h"
#include "threads.h"

static double *cell(double *rows, int row, const grouser_fleet *fleet, int vehicle) {
  return rows + (size_t)row * (size_t)fleet->vehicles + (size_t)vehicle;
}

static double number(const grouser_fleet *fleet, double *rows, int row, int vehicle) {
  return *cell(rows, row, fleet, vehicle);
}

void grouser_fleet_load(const grouser_fleet *fleet, int vehicle, grouser_vehicle_state *state) {
  state->x = number(fleet, fleet->state, GROUSER_STATE_X, vehicle);
  state->y = number(fleet, fleet->state, GROUSER_STATE_Y, vehicle);
  state->heading = number(fleet, fleet->state, GROUSER_STATE_HEADING, vehicle);
  state->vx = number(fleet, fleet->state, GROUSER_STATE_VX, vehicle);
  state->vy = number(fleet, fleet->state, GROUSER_STATE_VY, vehicle);
  state->yaw_rate = number(fleet, fleet->state, GROUSER_STATE_YAW_RATE, vehicle);
  state->v_left = number(fleet, fleet->state, GROUSER_STATE_V_LEFT, vehicle);
  state->v_right = number(fleet, fleet->state, GROUSER_STATE_V_RIGHT, vehicle);
  state->ax = number(fleet, fleet->state, GROUSER_STATE_AX, vehicle);
  state->ay = number(fleet, fleet->state, GROUSER_STATE_AY, vehicle);
  state->time = number(fleet, fleet->state, GROUSER_STATE_TIME, vehicle);
  state->guard = grouser_guard_fresh();
  if (!fleet->plant->guard) return;
  const double flags = number(fleet, fleet->guard, GROUSER_GUARD_FLAGS, vehicle);
  const double samples = number(fleet, fleet->guard, GROUSER_GUARD_SAMPLES, vehicle);
  state->guard.mode = number(fleet, fleet->guard, GROUSER_GUARD_MODE, vehicle) > 0 ? GROUSER_FALLBACK : GROUSER_PRIMARY;
  /* Anything may stand in a caller's array, and converting a number out of range is undefined. */
  state->guard.samples = samples > 0 ? (int)fmin(samples, GROUSER_MAX_ENTRY_WINDOW) : 0;
  state->guard.flags = flags > 0 ? (uint32_t)fmin(flags, UINT32_MAX) : 0;
  state->guard.dwell = number(fleet, fleet->guard, GROUSER_GUARD_DWELL, vehicle);
  state->guard.calm = number(fleet, fleet->guard, GROUSER_GUARD_CALM, vehicle);
  state->guard.fallback_weight = number(fleet, fleet->guard, GROUSER_GUARD_WEIGHT, vehicle);
}

void grouser_fleet_store(const grouser_fleet *fleet, int vehicle, const grouser_vehicle_state *state,
                         const grouser_tick_record *record) {
  const double numbers[GROUSER_STATE_ROWS] = {state->x,        state->y,      state->heading, state->vx,
                                              state->vy,       state->yaw_rate, state->v_left, state->v_right,
                                              state->ax,       state->ay,     state->time};
  for (int row = 0; row < GROUSER_STATE_ROWS; row++) *cell(fleet->state, row, fleet, vehicle) = numbers[row];
  if (fleet->plant->guard) {
    const grouser_guard_state *guard = &state->guard;
    const double memory[GROUSER_GUARD_ROWS] = {(double)guard->mode, (double)guard->samples, (double)guard->flags,
                                               guard->dwell,        guard->calm,            guard->fallback_weight};
    for (int row = 0; row < GROUSER_GUARD_ROWS; row++) *cell(fleet->guard, row, fleet, vehicle) = memory[row];
  }
  for (int n = 0; n < fleet->plant->kernel->columns; n++)
    *cell(fleet->record, GROUSER_RECORD_ROW + n, fleet, vehicle) = record->row[n];
  for (int n = 0; n < GROUSER_OUTPUTS; n++)
    *cell(fleet->record, GROUSER_RECORD_FORCE + n, fleet, vehicle) = record->force[n];
  *cell(fleet->record, GROUSER_RECORD_ITERATIONS, fleet, vehicle) = record->iterations;
  *cell(fleet->record, GROUSER_RECORD_DIVISIONS, fleet, vehicle) = record->divisions;
  *cell(fleet->record, GROUSER_RECORD_SCORE, fleet, vehicle) = record->detection.score;
  *cell(fleet->record, GROUSER_RECORD_REASON, fleet, vehicle) = (double)record->detection.reason;
  *cell(fleet->record, GROUSER_RECORD_WORST_COLUMN, fleet, vehicle) = record->detection.worst_column;
}

typedef struct {
  const grouser_fleet *fleet;
  const double *commands;
  int ticks;
} round_of_ticks;

/* Whole blocks to every thread, so that no two write to one cache line but at the ends of their shares. */
static void advance_share(void *work, int part, int parts) {
  const round_of_ticks *round = (const round_of_ticks *)work;
  const int vehicles = round->fleet->vehicles;
  const int blocks = vehicles / GROUSER_BLOCK + (vehicles % GROUSER_BLOCK != 0);
  const int each = blocks / parts, more = blocks % parts;
  const int first = part * each + (part < more ? part : more);
  const int last = first + each + (part < more);
  /* In vehicles; the product stays below the number of vehicles but for the last block. */
  const int end = last == blocks ? vehicles : last * GROUSER_BLOCK;
  if (first < last) grouser_fleet_advance_range(round->fleet, round->commands, round->ticks, first * GROUSER_BLOCK, end);
}

void grouser_fleet_advance(const grouser_fleet *fleet, const double *commands, int ticks, struct grouser_pool *pool) {
  round_of_ticks round = {fleet, commands, ticks};
  if (pool)
    grouser_pool_run(pool, advance_share, &round);
  else
    advance_share(&round, 0, 1);
}
