/* The same as load.h for a block of vehicles, lane by lane. */
#ifndef GROUSER_LOAD_BLOCK_H
#define GROUSER_LOAD_BLOCK_H

#include "grouser/kernel.h"
#include "grouser/physics.h"

/* Between a track and its mirror image. */
static inline double grouser_sign(enum grouser_side side) { return side == GROUSER_LEFT ? 1.0 : -1.0; }

static inline const double *grouser_belt_in(const grouser_block_rows *rows, enum grouser_side side) {
  return rows->column[side == GROUSER_LEFT ? GROUSER_V_LEFT : GROUSER_V_RIGHT];
}

/* As grouser_element_shares. */
GROUSER_CORE void grouser_block_shares(const grouser_physics *block, const grouser_block_rows *rows,
                                       double (*share)[GROUSER_BLOCK]);

/* As grouser_side_load and grouser_shear_strength: writes load and elements' strengths of a track, in N. */
GROUSER_CORE void grouser_load_block(const grouser_physics *block, const grouser_block_rows *rows,
                                     enum grouser_side side, const double (*share)[GROUSER_BLOCK], double *track_load,
                                     double (*stress)[GROUSER_BLOCK]);

#endif
