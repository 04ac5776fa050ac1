#include "grouser/task.h"

#include <math.h>
#include <string.h>

static double clamp(double value, double limit) { return fmin(limit, fmax(-limit, value)); }

void grouser_task_command(const grouser_task *task, const double action[2], double command[2]) {
  const double limit = task->training_speed;
  if (!task->twist) {
    command[0] = limit * action[0];
    command[1] = limit * action[1];
    return;
  }
  const double speed = limit * action[0], half_difference = task->yaw_rate_scale * action[1] * task->tread / 2;
  command[0] = clamp(speed - half_difference, limit);
  command[1] = clamp(speed + half_difference, limit);
}

float grouser_task_bounded(const grouser_task *task, double value) { return (float)clamp(value, task->bound); }

void grouser_task_observe(const grouser_task *task, const grouser_sight *sight, const double action[2],
                          float *observation) {
  const double motion[GROUSER_SEEN_MOTION] = {
      sight->vx / task->training_speed, sight->vy / task->training_speed, sight->yaw_rate / task->yaw_rate_scale,
      sight->v_left / task->training_speed, sight->v_right / task->training_speed};
  for (int part = 0; part < GROUSER_SEEN_MOTION; part++) observation[part] = grouser_task_bounded(task, motion[part]);
  float *next = observation + GROUSER_SEEN_MOTION + GROUSER_SEEN_TASK;
  for (int part = 0; part < GROUSER_SEEN_ACTION; part++) *next++ = grouser_task_bounded(task, action[part]);
  for (int part = 0; part < task->parameters; part++) {
    const double low = task->low[part], high = task->high[part];
    *next++ = grouser_task_bounded(task, 2 * (sight->parameters[part] - low) / (high - low) - 1);
  }
}

void grouser_task_costs(const grouser_task *task, const double action[2], const double previous[2], double slip_power,
                        double terms[2]) {
  const double left = action[0] - previous[0], right = action[1] - previous[1];
  terms[0] = -task->action_change_weight * (left * left + right * right);
  terms[1] = -task->slip_power_weight * slip_power / task->slip_power_scale;
}

int grouser_task_observation_size(const grouser_task *task) {
  return GROUSER_SEEN_MOTION + GROUSER_SEEN_TASK + GROUSER_SEEN_ACTION + task->parameters;
}
