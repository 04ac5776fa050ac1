/* The path-tracking task: what is its own. Scales and terms: envs/path_tracking.py. */
#ifndef GROUSER_TRACKING_H
#define GROUSER_TRACKING_H

#include "path.h"
#include "task.h"

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

/* Moves the foot after the vehicle. */
void grouser_tracking_follow(const grouser_tracking *tracking, grouser_tracking_memory *memory,
                             const grouser_sight *sight);

/* Moves the foot, writes the terms of progress and cross-track error, and returns whether the episode ends. */
int grouser_tracking_assess(const grouser_tracking *tracking, grouser_tracking_memory *memory,
                            const grouser_sight *sight, double terms[2]);

/* Writes errors and look-ahead points: GROUSER_SEEN_TASK numbers. */
void grouser_tracking_observe(const grouser_tracking *tracking, const grouser_tracking_memory *memory,
                              const grouser_task *task, const grouser_sight *sight, float *observation);

/* Cross-track error and progress in m. */
void grouser_tracking_measure(const grouser_tracking_memory *memory, double measures[GROUSER_TASK_MEASURES]);

#endif
