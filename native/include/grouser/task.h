/* What every task of a tracked vehicle shares: commands, slip power, and the common parts of observation and reward.
 * Scales and terms: envs/task.py. */
#ifndef GROUSER_TASK_H
#define GROUSER_TASK_H

#include "ground.h"
#include "kernel.h"

enum {
  GROUSER_TASK_TERMS = 4,       /* of the reward: two of the task, then action change and slip power */
  GROUSER_TASK_MEASURES = 2,    /* what a task tells of a vehicle, in SI units */
  /* Parts of an observation, in order: motion, what the task shows, previous action, terrain parameters. */
  GROUSER_SEEN_MOTION = 5,
  GROUSER_SEEN_TASK = 12,
  GROUSER_SEEN_ACTION = 2
};

typedef struct {
  int twist;                    /* an action is speed and yaw rate, not left and right belt */
  int parameters;               /* terrain parameters that are observed, or 0 */
  long steps;                   /* control periods until an episode is truncated */
  double control_period;        /* s */
  double training_speed, tread; /* m/s, m */
  double yaw_rate_scale;        /* rad/s */
  double bound;                 /* of every part of an observation */
  double action_change_weight, slip_power_weight, slip_power_scale; /* the last in W */
  double broken_off_reward;
  double low[GROUSER_MAX_PARAMETERS], high[GROUSER_MAX_PARAMETERS];
} grouser_task;

/* A vehicle at a control instant. */
typedef struct {
  double x, y, heading;                 /* m, m, rad */
  double vx, vy, yaw_rate;              /* m/s, m/s, rad/s */
  double v_left, v_right;               /* m/s */
  double parameters[GROUSER_MAX_PARAMETERS]; /* of the ground at (x, y), where they are observed */
} grouser_sight;

/* Belt-speed command in m/s for an action in [-1, 1]^2; a twist saturates at the belts. */
void grouser_task_command(const grouser_task *task, const double action[2], double command[2]);

/* Writes what is not the task's own into an observation: GROUSER_SEEN_MOTION first, and after the task's part the
 * action and the terrain. */
void grouser_task_observe(const grouser_task *task, const grouser_sight *sight, const double action[2],
                          float *observation);

/* A part of an observation within its bound. */
float grouser_task_bounded(const grouser_task *task, double value);

/* Terms of action change and slip power. */
void grouser_task_costs(const grouser_task *task, const double action[2], const double previous[2], double slip_power,
                        double terms[2]);

int grouser_task_observation_size(const grouser_task *task);

#endif
