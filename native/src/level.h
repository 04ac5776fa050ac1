/* The kernels, compiled once for each vector level of the processor, and the level that this one runs. */
#ifndef GROUSER_LEVEL_H
#define GROUSER_LEVEL_H

#include "grouser/fleet.h"
#include "grouser/gated.h"
#include "grouser/kernel.h"
#include "grouser/mlp.h"
#include "grouser/physics.h"
#include "grouser/track_net.h"

typedef struct {
  const char *name; /* "x86-64-v4", "x86-64-v3" or "portable" */
  /* Each points a kernel at a block, which must outlive it; networks are made ready, too. */
  grouser_kernel (*physics)(const grouser_physics *block);
  grouser_kernel (*mlp)(grouser_mlp *net);
  grouser_kernel (*gated)(const grouser_gated *gated);
  grouser_kernel (*track_net)(grouser_track_net *net);
  grouser_advance_lanes advance_lanes;
} grouser_level;

/* Compiled levels that the processor can run, best first; returns how many. */
enum { GROUSER_LEVELS = 3 };
int grouser_levels(const grouser_level *levels[GROUSER_LEVELS]);

#endif
