/* GROUSER_BLOCK vehicles side by side: what a fleet's arrays hold of them, and a tick of each from its beginning to its
 * end, but for its solution. Loops over lanes decide nothing by branches, so that they are vectorised; every lane has
 * the bits of a vehicle alone. */
#ifndef GROUSER_FLEET_BLOCK_H
#define GROUSER_FLEET_BLOCK_H

#include "grouser/fleet.h"
#include "tick_parts.h"

/* What solved a tick. */
typedef struct {
  double body[3][GROUSER_BLOCK];     /* at its end */
  double received[3][GROUSER_BLOCK]; /* the body of the accepted evaluation */
  double force[GROUSER_OUTPUTS][GROUSER_BLOCK];
  double iterations[GROUSER_BLOCK], divisions[GROUSER_BLOCK];
} grouser_block_solution;

/* What the last tick that was solved did. */
typedef struct {
  double row[GROUSER_MAX_COLUMNS][GROUSER_BLOCK];
  double force[GROUSER_OUTPUTS][GROUSER_BLOCK];
  double iterations[GROUSER_BLOCK], divisions[GROUSER_BLOCK];
  grouser_detection detection[GROUSER_BLOCK];
  int any[GROUSER_BLOCK]; /* whether there was one */
} grouser_block_record;

typedef struct {
  double state[GROUSER_STATE_ROWS][GROUSER_BLOCK], cosine[GROUSER_BLOCK], sine[GROUSER_BLOCK];
  double command[2][GROUSER_BLOCK];
  double yaw_inertia[GROUSER_BLOCK], belt_time_constant[GROUSER_BLOCK], belt_acceleration[GROUSER_BLOCK];
  double decay[GROUSER_BLOCK], half_decay[GROUSER_BLOCK];
  /* Of this tick, as grouser_tick_start has them. */
  double row[GROUSER_MAX_COLUMNS][GROUSER_BLOCK];
  double belts[2][GROUSER_BLOCK], yaw_acceleration[GROUSER_BLOCK];
  double theta[2][GROUSER_MAX_PARAMETERS][GROUSER_BLOCK], pull[2][GROUSER_BLOCK], load_ratio[GROUSER_BLOCK];
  int64_t ticking[GROUSER_BLOCK], solved[GROUSER_BLOCK]; /* whether this tick has begun, and whether it is solved */
  grouser_block_solution solution;
  grouser_block_record record;
  grouser_guard_state guard[GROUSER_BLOCK], next_guard[GROUSER_BLOCK];
  grouser_detection detection[GROUSER_BLOCK];
  int count, ground_varies; /* vehicles; whether the ground under any of them depends on where it is or heads */
  int vehicle[GROUSER_BLOCK];
  enum grouser_status status[GROUSER_BLOCK];
} grouser_fleet_block;

/* Takes up to GROUSER_BLOCK vehicles that are not lost; returns the first that there was no room for, or `end`. */
GROUSER_CORE int grouser_block_load(grouser_fleet_block *block, const grouser_fleet *fleet, const double *commands,
                                    int first, int end);
/* Writes what has become of them. */
GROUSER_CORE void grouser_block_store(const grouser_fleet_block *block, const grouser_fleet *fleet);

/* Turns the vehicles to their headings, and puts them on their grounds. */
GROUSER_CORE void grouser_block_ready(grouser_fleet_block *block, const grouser_fleet *fleet);

/* Begins a tick of every vehicle that is not lost. */
GROUSER_CORE void grouser_block_begin(grouser_fleet_block *block, const grouser_fleet *fleet);

/* Solves the tick of one lane by itself: every guess, every division, and both kernels of a guard. */
GROUSER_CORE void grouser_block_solve(grouser_fleet_block *block, const grouser_fleet *fleet, int lane);

/* Moves the vehicles whose tick is solved. One whose end is not finite is lost, and stays where it was. */
GROUSER_CORE void grouser_block_finish(grouser_fleet_block *block, const grouser_plant *plant);

#endif
