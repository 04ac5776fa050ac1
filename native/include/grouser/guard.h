/* The guard of one vehicle: when it changes over to the fallback, and what it returns meanwhile. Meaning and names:
 * terrain/guard.py. */
#ifndef GROUSER_GUARD_H
#define GROUSER_GUARD_H

#include <stdint.h>

#include "detector.h"
#include "kernel.h"

enum grouser_guard_mode { GROUSER_PRIMARY = 0, GROUSER_FALLBACK = 1 };

enum { GROUSER_MAX_ENTRY_WINDOW = 32 };

/* When to change over, and how softly. */
typedef struct {
  int entry_votes, entry_window; /* 1..entry_window, 1..GROUSER_MAX_ENTRY_WINDOW */
  double exit_score;             /* in (0, 1] */
  double exit_time, minimum_dwell; /* s */
  int blend_samples;             /* at least 1 */
} grouser_switching_policy;

/* What each vehicle carries from tick to tick. */
typedef struct {
  enum grouser_guard_mode mode;
  int samples;            /* of flags, at most entry_window */
  uint32_t flags;         /* whether the latest samples were out of distribution, newest in bit 0 */
  double dwell, calm;     /* s in this mode, and since the score was last at or above exit_score */
  double fallback_weight; /* share of the fallback in the blended output */
} grouser_guard_state;

/* A guard over a primary kernel that is named elsewhere. */
typedef struct {
  const grouser_kernel *fallback;
  grouser_detector detector;
  grouser_switching_policy policy;
} grouser_guard;

/* On the primary for as long as anyone remembers. */
grouser_guard_state grouser_guard_fresh(void);

/* The guard's state for a tick of `elapsed` s whose input was scored as `detection`. */
grouser_guard_state grouser_guard_advance(const grouser_switching_policy *policy, const grouser_guard_state *state,
                                          const grouser_detection *detection, double elapsed);

/* (1 - w) primary + w fallback. */
typedef struct {
  const grouser_kernel *primary, *fallback; /* fallback may be NULL: the primary alone */
  double fallback_weight;
  int primary_failed; /* set where the primary refused a row or was not finite, and so was left out */
} grouser_blend;

/* Forces of one vehicle and their derivatives by vx, vy and yaw rate; NaN where a row is refused. `right` is the row of
 * the right track, or NULL where it is that of the left one. `slopes` may be NULL; where they are wanted, a primary
 * whose slopes are not finite has failed, too. */
void grouser_kernel_forces(const grouser_kernel *kernel, const double *left, const double *right,
                           enum grouser_slopes_wanted wanted, double forces[GROUSER_OUTPUTS],
                           double slopes[GROUSER_OUTPUTS][3]);
void grouser_blend_forces(grouser_blend *blend, const double *left, const double *right,
                          double forces[GROUSER_OUTPUTS], double slopes[GROUSER_OUTPUTS][3]);

#endif
