/* The track-terrain block for many vehicles at once: a cell at a time, lane by lane. */
#ifndef GROUSER_PHYSICS_BLOCK_H
#define GROUSER_PHYSICS_BLOCK_H

#include "grouser/kernel.h"
#include "grouser/physics.h"

/* Whether the block is of the kind below: float64 on the soft path. */
GROUSER_CORE int grouser_physics_has_block(const grouser_physics *block);

/* As evaluate_track_block of a grouser_kernel. */
GROUSER_CORE void grouser_physics_track_block(const grouser_physics *block, const grouser_block_rows *rows,
                                              enum grouser_side side, double force[GROUSER_OUTPUTS][GROUSER_BLOCK]);

#endif
