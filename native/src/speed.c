#include "grouser/speed.h"

#include <math.h>

grouser_twist grouser_speed_reference(const grouser_speed *speed, const grouser_twist *profile, double time) {
  const double share = floor(time / speed->segment);
  if (share >= (double)(speed->knots - 1)) return profile[speed->knots - 1];
  const long knot = (long)share;
  const double u = fmin(1.0, (time - share * speed->segment) / speed->ramp), rise = u * u * (3.0 - 2.0 * u);
  const grouser_twist from = profile[knot], to = profile[knot + 1];
  return (grouser_twist){from.speed + rise * (to.speed - from.speed),
                         from.yaw_rate + rise * (to.yaw_rate - from.yaw_rate)};
}

static double earned(double weight, double error, double tolerance) {
  const double ratio = error / tolerance;
  return weight / (1.0 + ratio * ratio);
}

void grouser_speed_measure(const grouser_speed *speed, const grouser_twist *profile, double time,
                           const grouser_sight *sight, double measures[GROUSER_TASK_MEASURES]) {
  const grouser_twist reference = grouser_speed_reference(speed, profile, time);
  measures[0] = sight->vx - reference.speed;
  measures[1] = sight->yaw_rate - reference.yaw_rate;
}

void grouser_speed_assess(const grouser_speed *speed, const grouser_twist *profile, double time,
                          const grouser_sight *sight, double terms[2]) {
  double errors[GROUSER_TASK_MEASURES];
  grouser_speed_measure(speed, profile, time, sight, errors);
  terms[0] = earned(speed->speed_weight, errors[0], speed->speed_tolerance);
  terms[1] = earned(speed->yaw_rate_weight, errors[1], speed->yaw_rate_tolerance);
}

void grouser_speed_observe(const grouser_speed *speed, const grouser_twist *profile, double time,
                           const grouser_task *task, const grouser_sight *sight, float *observation) {
  double errors[GROUSER_TASK_MEASURES];
  grouser_speed_measure(speed, profile, time, sight, errors);
  *observation++ = grouser_task_bounded(task, errors[0] / task->training_speed);
  *observation++ = grouser_task_bounded(task, errors[1] / task->yaw_rate_scale);
  for (int n = 0; n < GROUSER_PREVIEW; n++) {
    const grouser_twist reference = grouser_speed_reference(speed, profile, time + speed->ahead[n]);
    *observation++ = grouser_task_bounded(task, reference.speed / task->training_speed);
    *observation++ = grouser_task_bounded(task, reference.yaw_rate / task->yaw_rate_scale);
  }
}
