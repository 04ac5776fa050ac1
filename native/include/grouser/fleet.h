/* Many vehicles of one kind, each on its own ground, tick by tick. What one of them does is the same to the bit
 * whatever stands beside it, and on however many threads. */
#ifndef GROUSER_FLEET_H
#define GROUSER_FLEET_H

#include "tick.h"

/* Rows of the arrays below, one column a vehicle. */
enum grouser_state_row {
  GROUSER_STATE_X,
  GROUSER_STATE_Y,
  GROUSER_STATE_HEADING,
  GROUSER_STATE_VX,
  GROUSER_STATE_VY,
  GROUSER_STATE_YAW_RATE,
  GROUSER_STATE_V_LEFT,
  GROUSER_STATE_V_RIGHT,
  GROUSER_STATE_AX,
  GROUSER_STATE_AY,
  GROUSER_STATE_TIME,
  GROUSER_STATE_ROWS
};
enum grouser_guard_row {
  GROUSER_GUARD_MODE,
  GROUSER_GUARD_SAMPLES,
  GROUSER_GUARD_FLAGS, /* the bit mask as a number: 32 bits are exact in a double */
  GROUSER_GUARD_DWELL,
  GROUSER_GUARD_CALM,
  GROUSER_GUARD_WEIGHT,
  GROUSER_GUARD_ROWS
};
enum grouser_record_row {
  GROUSER_RECORD_ROW, /* GROUSER_MAX_COLUMNS of them; 0 beyond the columns of the mode */
  GROUSER_RECORD_FORCE = GROUSER_RECORD_ROW + GROUSER_MAX_COLUMNS,
  GROUSER_RECORD_ITERATIONS = GROUSER_RECORD_FORCE + GROUSER_OUTPUTS,
  GROUSER_RECORD_DIVISIONS,
  GROUSER_RECORD_SCORE,
  GROUSER_RECORD_REASON,
  GROUSER_RECORD_WORST_COLUMN,
  GROUSER_RECORD_ROWS
};

typedef struct grouser_fleet grouser_fleet;

/* Advances the vehicles from `first` up to but not including `end`, as grouser_fleet_advance does all of them. */
typedef void (*grouser_advance_lanes)(const grouser_fleet *fleet, const double *commands, int ticks, int first,
                                      int end);

struct grouser_fleet {
  const grouser_plant *plant;
  int vehicles;
  const grouser_ground *grounds; /* vehicles */
  const grouser_traits *traits;  /* vehicles */
  double *state;                 /* GROUSER_STATE_ROWS x vehicles */
  double *guard;                 /* GROUSER_GUARD_ROWS x vehicles */
  double *record;                /* GROUSER_RECORD_ROWS x vehicles: of the last tick that was solved */
  unsigned char *status;         /* vehicles, enum grouser_status: one that is not solved is left alone */
  grouser_advance_lanes advance_lanes; /* of a vector level: they differ in nothing but speed */
};

/* Vehicles from `first` up to but not including `end`. */
typedef struct {
  int first, end;
} grouser_range;

int grouser_fleet_blocks(int vehicles);

/* One of `parts` shares of the vehicles, counted from 0: whole blocks. */
grouser_range grouser_share_of(int vehicles, int part, int parts);

struct grouser_pool;

/* Advances every vehicle by `ticks` under the commands (vehicles x 2: left, right; m/s). A vehicle that is lost on the
 * way keeps the state before that tick. `pool` may be NULL: the caller's thread alone. */
void grouser_fleet_advance(const grouser_fleet *fleet, const double *commands, int ticks, struct grouser_pool *pool);

#endif
