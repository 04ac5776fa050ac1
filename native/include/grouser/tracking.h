/* The path-tracking task: what is its own. Scales and terms: envs/path_tracking.py. */
#ifndef GROUSER_TRACKING_H
#define GROUSER_TRACKING_H

#include "episodes.h"
#include "path.h"

enum { GROUSER_LOOK_AHEAD = 5 };

typedef struct {
  grouser_path path;
  double reference_speed;              /* m/s */
  double full_progress;                /* m, in a control period at reference speed */
  double maximum_cross_track;          /* m */
  double progress_weight, cross_track_weight;
  double ahead[GROUSER_LOOK_AHEAD];    /* m, of the look-ahead points */
} grouser_tracking;

/* What an episode remembers. */
typedef struct {
  double start;                        /* m, arc length at which it began */
  grouser_foot foot;
} grouser_tracking_memory;

/* The task as episodes take it. The start of an episode sets its memory. */
grouser_rules grouser_tracking_rules(const grouser_tracking *tracking);

#endif
