#include "grouser/tracking.h"

#include <math.h>

static const double PI = 3.14159265358979323846;
static const double WINDOW = 5.0; /* m: what Path.project searches around a former foot */

void grouser_tracking_follow(const grouser_tracking *tracking, grouser_tracking_memory *memory,
                             const grouser_sight *sight) {
  memory->foot = grouser_path_project(&tracking->path, sight->x, sight->y, memory->foot.arc_length, WINDOW);
}

int grouser_tracking_assess(const grouser_tracking *tracking, grouser_tracking_memory *memory,
                            const grouser_sight *sight, double terms[2]) {
  const double before = memory->foot.arc_length;
  grouser_tracking_follow(tracking, memory, sight);
  const double s = memory->foot.arc_length, cross_track = memory->foot.cross_track;
  const double progress = (s - before) / tracking->full_progress, half = cross_track / 2.0;
  terms[0] = tracking->progress_weight * fmin(progress, 2.0 - progress);
  terms[1] = -tracking->cross_track_weight * (half * half);
  const double driven = tracking->path.closed ? s - memory->start : s;
  return driven >= tracking->path.length || fabs(cross_track) > tracking->maximum_cross_track;
}

void grouser_tracking_observe(const grouser_tracking *tracking, const grouser_tracking_memory *memory,
                              const grouser_task *task, const grouser_sight *sight, float *observation) {
  const grouser_foot *foot = &memory->foot;
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

void grouser_tracking_measure(const grouser_tracking_memory *memory, double measures[GROUSER_TASK_MEASURES]) {
  measures[0] = memory->foot.cross_track;
  measures[1] = memory->foot.arc_length - memory->start;
}
