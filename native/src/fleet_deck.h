/* GROUSER_BLOCK ticks that are solved side by side, by Broyden's steps: each lane has its own tick, begun elsewhere,
 * and its own progress. Every decision looks at its own lane alone, so that the bits of a tick do not depend on what is
 * solved beside it. */
#ifndef GROUSER_FLEET_DECK_H
#define GROUSER_FLEET_DECK_H

#include "tick_parts.h"

typedef struct {
  grouser_block_rows left, right;
  grouser_block_forces forces;
  double prepared[GROUSER_MAX_PREPARED][GROUSER_BLOCK]; /* by the kernel */
  double anchor[3][GROUSER_BLOCK], pull[2][GROUSER_BLOCK], load_ratio[GROUSER_BLOCK], yaw_inertia[GROUSER_BLOCK];
  double inverse[3][3][GROUSER_BLOCK];
  double step[3][GROUSER_BLOCK];                          /* the next one */
  double size[GROUSER_BLOCK], size_before[GROUSER_BLOCK]; /* of the residual, now and a step ago */
  int stage[GROUSER_BLOCK], iteration[GROUSER_BLOCK], iterations[GROUSER_BLOCK];
  int active[GROUSER_BLOCK];
} grouser_deck;

enum grouser_progress {
  GROUSER_ITERATES,
  GROUSER_CONVERGED,
  GROUSER_STUCK /* the tick needs Newton's steps, damping, another guess, a shorter step or the fallback */
};

/* Puts a tick that has begun into a lane. */
void grouser_deck_enter(grouser_deck *deck, const grouser_plant *plant, int columns, int lane,
                        const grouser_tick_start *start);

/* Moves a tick to another lane, of this deck or of another one that has opened, too. */
void grouser_deck_move(grouser_deck *from, int lane, grouser_deck *to, int free_lane, const grouser_kernel *kernel,
                       int split);

/* Evaluates forces and slopes of lanes that have just entered, and the step that they ask for. */
void grouser_deck_open(grouser_deck *deck, const grouser_plant *plant, const grouser_kernel *kernel);

/* Evaluates the forces of lanes that have taken a step, and the next one. */
void grouser_deck_follow(grouser_deck *deck, const grouser_plant *plant, const grouser_kernel *kernel);

/* Takes the step of one lane, or writes the solution; one that does not iterate is active no longer. */
enum grouser_progress grouser_deck_proceed(grouser_deck *deck, const grouser_plant *plant, int lane,
                                           const grouser_tick_start *start, grouser_body_step *solution);

#endif
