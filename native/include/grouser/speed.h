/* The speed-tracking task: what is its own. Scales and terms: envs/speed_tracking.py. */
#ifndef GROUSER_SPEED_H
#define GROUSER_SPEED_H

#include "episodes.h"

enum { GROUSER_PREVIEW = 5 };

/* Commanded speed and yaw rate. */
typedef struct {
  double speed, yaw_rate; /* m/s, rad/s */
} grouser_twist;

typedef struct {
  long knots;                            /* of a profile, at least 1 */
  double segment, ramp;                  /* s: from knot to knot, and the part of it in which the reference changes */
  double speed_weight, yaw_rate_weight;
  double speed_tolerance, yaw_rate_tolerance; /* errors that earn half, in m/s and rad/s */
  double ahead[GROUSER_PREVIEW];         /* s, of the preview */
} grouser_speed;

/* The profile's reference at a time in s: smooth from knot to knot, and the last knot for good. */
grouser_twist grouser_speed_reference(const grouser_speed *speed, const grouser_twist *profile, double time);

/* The task as episodes take it. An episode's memory is its profile, set at its start. */
grouser_rules grouser_speed_rules(const grouser_speed *speed);

#endif
