#include "grouser/tracking.h"

#include <math.h>

static const double PI = 3.14159265358979323846;
static const double WINDOW = 5.0; /* m: what Path.project searches around a former foot */

static void follow(const void *self, void *memory, const grouser_sight *sight) {
  /* A vehicle that was set to no position has no foot. */
  if (!isfinite(sight->x + sight->y)) return;
  const grouser_tracking *tracking = (const grouser_tracking *)self;
  grouser_foot *foot = &((grouser_tracking_memory *)memory)->foot;
  *foot = grouser_path_project(&tracking->path, sight->x, sight->y, foot->arc_length, WINDOW);
}

/* Terms of progress and cross-track error. */
static int assess(const void *self, void *memory, double time, const grouser_sight *sight, double terms[2]) {
  (void)time;
  const grouser_tracking *tracking = (const grouser_tracking *)self;
  const grouser_tracking_memory *drive = (const grouser_tracking_memory *)memory;
  const double before = drive->foot.arc_length;
  follow(self, memory, sight);
  const double s = drive->foot.arc_length, cross_track = drive->foot.cross_track;
  const double progress = (s - before) / tracking->full_progress, half = cross_track / 2.0;
  terms[0] = tracking->progress_weight * fmin(progress, 2.0 - progress);
  terms[1] = -tracking->cross_track_weight * (half * half);
  const double driven = tracking->path.closed ? s - drive->start : s;
  return driven >= tracking->path.length || fabs(cross_track) > tracking->maximum_cross_track;
}

/* Errors, then look-ahead points in the body frame. */
static void observe(const void *self, const void *memory, double time, const grouser_task *task,
                    const grouser_sight *sight, float *observation) {
  (void)time;
  const grouser_tracking *tracking = (const grouser_tracking *)self;
  const grouser_foot *foot = &((const grouser_tracking_memory *)memory)->foot;
  *observation++ = grouser_task_bounded(task, foot->cross_track / tracking->maximum_cross_track);
  *observation++ = grouser_task_bounded(task, remainder(sight->heading - foot->point.heading, 2 * PI) / PI);
  const double cosine = cos(sight->heading), sine = sin(sight->heading);
  const double farthest = tracking->ahead[GROUSER_LOOK_AHEAD - 1];
  for (int n = 0; n < GROUSER_LOOK_AHEAD; n++) {
    const grouser_path_point point = grouser_path_at(&tracking->path, foot->arc_length + tracking->ahead[n]);
    const double dx = point.x - sight->x, dy = point.y - sight->y;
    *observation++ = grouser_task_bounded(task, (cosine * dx + sine * dy) / farthest);
    *observation++ = grouser_task_bounded(task, (cosine * dy - sine * dx) / farthest);
  }
}

/* Cross-track error and progress in m. */
static void measure(const void *self, const void *memory, double time, const grouser_sight *sight,
                    double measures[GROUSER_TASK_MEASURES]) {
  (void)self;
  (void)time;
  (void)sight;
  const grouser_tracking_memory *drive = (const grouser_tracking_memory *)memory;
  measures[0] = drive->foot.cross_track;
  measures[1] = drive->foot.arc_length - drive->start;
}

grouser_rules grouser_tracking_rules(const grouser_tracking *tracking) {
  return (grouser_rules){tracking, sizeof(grouser_tracking_memory), follow, assess, observe, measure};
}
