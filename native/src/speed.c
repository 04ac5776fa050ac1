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

/* The profile stays; only the time goes on. */
static void follow(const void *self, void *memory, const grouser_sight *sight) {
  (void)self;
  (void)memory;
  (void)sight;
}

/* Errors of speed and yaw rate, in m/s and rad/s. */
static void measure(const void *self, const void *memory, double time, const grouser_sight *sight,
                    double measures[GROUSER_TASK_MEASURES]) {
  const grouser_twist reference =
      grouser_speed_reference((const grouser_speed *)self, (const grouser_twist *)memory, time);
  measures[0] = sight->vx - reference.speed;
  measures[1] = sight->yaw_rate - reference.yaw_rate;
}

/* Terms of speed and yaw rate. */
static int assess(const void *self, void *memory, double time, const grouser_sight *sight, double terms[2]) {
  const grouser_speed *speed = (const grouser_speed *)self;
  double errors[GROUSER_TASK_MEASURES];
  measure(self, memory, time, sight, errors);
  terms[0] = earned(speed->speed_weight, errors[0], speed->speed_tolerance);
  terms[1] = earned(speed->yaw_rate_weight, errors[1], speed->yaw_rate_tolerance);
  return 0;
}

/* Errors, then the reference ahead. */
static void observe(const void *self, const void *memory, double time, const grouser_task *task,
                    const grouser_sight *sight, float *observation) {
  const grouser_speed *speed = (const grouser_speed *)self;
  double errors[GROUSER_TASK_MEASURES];
  measure(self, memory, time, sight, errors);
  *observation++ = grouser_task_bounded(task, errors[0] / task->training_speed);
  *observation++ = grouser_task_bounded(task, errors[1] / task->yaw_rate_scale);
  for (int n = 0; n < GROUSER_PREVIEW; n++) {
    const grouser_twist reference =
        grouser_speed_reference(speed, (const grouser_twist *)memory, time + speed->ahead[n]);
    *observation++ = grouser_task_bounded(task, reference.speed / task->training_speed);
    *observation++ = grouser_task_bounded(task, reference.yaw_rate / task->yaw_rate_scale);
  }
}

grouser_rules grouser_speed_rules(const grouser_speed *speed) {
  return (grouser_rules){speed, sizeof(grouser_twist) * (size_t)speed->knots, follow, assess, observe, measure};
}
