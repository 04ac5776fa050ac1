/* How the vehicles of a fleet are read from the arrays of its owner, and written. */
#include "fleet_block.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

static double *fleet_cell(double *rows, int row, const grouser_fleet *fleet, int vehicle) {
  return rows + (size_t)row * (size_t)fleet->vehicles + (size_t)vehicle;
}

static grouser_guard_state load_guard(const grouser_fleet *fleet, int vehicle) {
  grouser_guard_state guard;
  double number[GROUSER_GUARD_ROWS];
  for (int row = 0; row < GROUSER_GUARD_ROWS; row++) number[row] = *fleet_cell(fleet->guard, row, fleet, vehicle);
  const double samples = number[GROUSER_GUARD_SAMPLES], flags = number[GROUSER_GUARD_FLAGS];
  guard.mode = number[GROUSER_GUARD_MODE] > 0 ? GROUSER_FALLBACK : GROUSER_PRIMARY;
  /* Anything may stand in a caller's array, and converting a number out of range is undefined. */
  guard.samples = samples > 0 ? (int)fmin(samples, GROUSER_MAX_ENTRY_WINDOW) : 0;
  guard.flags = flags > 0 ? (uint32_t)fmin(flags, UINT32_MAX) : 0;
  guard.dwell = number[GROUSER_GUARD_DWELL];
  guard.calm = number[GROUSER_GUARD_CALM];
  guard.fallback_weight = number[GROUSER_GUARD_WEIGHT];
  return guard;
}

static void store_guard(const grouser_fleet *fleet, int vehicle, const grouser_guard_state *guard) {
  const double numbers[GROUSER_GUARD_ROWS] = {(double)guard->mode, (double)guard->samples, (double)guard->flags,
                                              guard->dwell,        guard->calm,            guard->fallback_weight};
  for (int row = 0; row < GROUSER_GUARD_ROWS; row++) *fleet_cell(fleet->guard, row, fleet, vehicle) = numbers[row];
}

static void load_lane(grouser_fleet_block *b, const grouser_fleet *fleet, const double *commands, int l, int vehicle) {
  const grouser_traits *traits = &fleet->traits[vehicle];
  b->vehicle[l] = vehicle;
  b->status[l] = GROUSER_SOLVED;
  for (int row = 0; row < GROUSER_STATE_ROWS; row++) b->state[row][l] = *fleet_cell(fleet->state, row, fleet, vehicle);
  for (int side = 0; side < 2; side++) b->command[side][l] = commands[2 * (size_t)vehicle + (size_t)side];
  b->yaw_inertia[l] = traits->yaw_inertia;
  b->belt_time_constant[l] = traits->belt_time_constant;
  b->belt_acceleration[l] = traits->belt_acceleration;
  b->decay[l] = traits->decay;
  b->half_decay[l] = traits->half_decay;
  b->guard[l] = b->next_guard[l] = fleet->plant->guard ? load_guard(fleet, vehicle) : grouser_guard_fresh();
}

int grouser_block_load(grouser_fleet_block *b, const grouser_fleet *fleet, const double *commands, int first, int end) {
  memset(b, 0, sizeof *b);
  for (; first < end && b->count < GROUSER_BLOCK; first++)
    if (fleet->status[first] == GROUSER_SOLVED) load_lane(b, fleet, commands, b->count++, first);
  for (int l = b->count; l < GROUSER_BLOCK; l++) b->status[l] = GROUSER_DIVERGED;
  return first;
}

void grouser_block_store(const grouser_fleet_block *b, const grouser_fleet *fleet) {
  const grouser_block_record *record = &b->record;
  for (int l = 0; l < b->count; l++) {
    const int vehicle = b->vehicle[l];
    fleet->status[vehicle] = (unsigned char)b->status[l];
    if (!record->any[l]) continue;
    for (int row = 0; row < GROUSER_STATE_ROWS; row++)
      *fleet_cell(fleet->state, row, fleet, vehicle) = b->state[row][l];
    if (fleet->plant->guard) store_guard(fleet, vehicle, &b->guard[l]);
    for (int n = 0; n < fleet->plant->kernel->columns; n++)
      *fleet_cell(fleet->record, GROUSER_RECORD_ROW + n, fleet, vehicle) = record->row[n][l];
    for (int n = 0; n < GROUSER_OUTPUTS; n++)
      *fleet_cell(fleet->record, GROUSER_RECORD_FORCE + n, fleet, vehicle) = record->force[n][l];
    *fleet_cell(fleet->record, GROUSER_RECORD_ITERATIONS, fleet, vehicle) = record->iterations[l];
    *fleet_cell(fleet->record, GROUSER_RECORD_DIVISIONS, fleet, vehicle) = record->divisions[l];
    *fleet_cell(fleet->record, GROUSER_RECORD_SCORE, fleet, vehicle) = record->detection[l].score;
    *fleet_cell(fleet->record, GROUSER_RECORD_REASON, fleet, vehicle) = (double)record->detection[l].reason;
    *fleet_cell(fleet->record, GROUSER_RECORD_WORST_COLUMN, fleet, vehicle) = record->detection[l].worst_column;
  }
}
