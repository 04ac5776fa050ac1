/* Episodes of one task on a fleet: actions in, observations, rewards and ends out. What one vehicle gets is the same to
 * the bit whatever stands beside it, and on however many threads. */
#ifndef GROUSER_EPISODES_H
#define GROUSER_EPISODES_H

#include <stddef.h>
#include <stdint.h>

#include "fleet.h"
#include "task.h"

/* What a task adds to what all share. `memory` is what it remembers of one episode; `time` in s is since its start. */
typedef struct {
  const void *self;
  size_t memory; /* bytes an episode, whole doubles */
  void (*follow)(const void *self, void *memory, const grouser_sight *sight);
  /* Follows, writes two terms of the reward, and returns whether the episode ends. */
  int (*assess)(const void *self, void *memory, double time, const grouser_sight *sight, double terms[2]);
  void (*observe)(const void *self, const void *memory, double time, const grouser_task *task,
                  const grouser_sight *sight, float *observation);
  void (*measure)(const void *self, const void *memory, double time, const grouser_sight *sight,
                  double measures[GROUSER_TASK_MEASURES]);
} grouser_rules;

typedef struct {
  const grouser_fleet *fleet;
  const grouser_task *task;
  const grouser_rules *rules;
  const grouser_kernel *slip_block; /* that knows the tracks apart */
  int ticks;                 /* in a control period */
  /* A row a vehicle, in and out. */
  const double *actions;     /* 2, in [-1, 1] */
  const unsigned char *idle; /* not 0: neither moves nor is assessed */
  float *observations;
  double *rewards;
  double *terms;             /* GROUSER_TASK_TERMS; 0 where the simulation broke off */
  double *measures;          /* GROUSER_TASK_MEASURES */
  unsigned char *terminated, *truncated;
  /* A row a vehicle, kept from step to step. */
  double *memory;            /* rules->memory bytes */
  double *periods;           /* control periods since the episode began */
  double *previous;          /* 2, the action before */
  double *parameters;        /* GROUSER_MAX_PARAMETERS, as last observed */
  double *poses;             /* 3: x, y and heading in m and rad where the last tick took its ground */
  double *commands;          /* 2, in m/s */
} grouser_episodes;

/* Holds every vehicle's action for one control period. `pool` may be NULL. */
void grouser_episodes_step(const grouser_episodes *episodes, struct grouser_pool *pool);

/* Begins the episode of a vehicle whose state, ground and task memory are set: writes its observation and measures. */
void grouser_episodes_begin(const grouser_episodes *episodes, int vehicle);

#endif
