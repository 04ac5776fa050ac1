/* What comes before and after the solution of a tick: the same for a vehicle alone and for one of a block. */
#ifndef GROUSER_TICK_PARTS_H
#define GROUSER_TICK_PARTS_H

#include "body.h"
#include "grouser/tick.h"

typedef struct {
  const grouser_traits *traits;    /* of the vehicle; set beforehand, as the cosine and the sine are */
  double cosine, sine;             /* of the heading at the tick's start, and at its end when it is finished */
  double belts[2];                 /* m/s, at the tick's end */
  double row[GROUSER_MAX_COLUMNS]; /* at its start, belts as the integrator takes them */
  double yaw_acceleration;         /* rad/s^2, that the belts let expect */
  grouser_footing footing;
  grouser_guard_state guard;
  grouser_detection detection;
} grouser_tick_start;

/* Fills the rest of `start`. */
enum grouser_status grouser_tick_begin(const grouser_plant *plant, const grouser_ground *ground,
                                       const double command[2], const grouser_vehicle_state *state,
                                       grouser_tick_start *start);

/* Solves the tick at leave: every guess, every division, and the fallback for the whole of it if the primary fails. */
enum grouser_status grouser_tick_solve(const grouser_plant *plant, grouser_tick_start *start,
                                       const grouser_vehicle_state *state, grouser_body_step *step);

/* Moves the vehicle; GROUSER_DIVERGED, and nothing is moved, where the end is not finite. */
enum grouser_status grouser_tick_finish(const grouser_plant *plant, grouser_tick_start *start, grouser_body body,
                                        const double force[GROUSER_OUTPUTS], grouser_vehicle_state *state);

#endif
