/* GROUSER_BLOCK ticks that are solved side by side, by Broyden's steps: each lane has its own tick, begun elsewhere,
 * and its own progress. Every decision looks at its own lane alone, so that the bits of a tick do not depend on what is
 * solved beside it. */
#ifndef GROUSER_FLEET_DECK_H
#define GROUSER_FLEET_DECK_H

#include "fleet_block.h"

enum grouser_progress {
  GROUSER_VACANT, /* nobody is in the lane any longer */
  GROUSER_ITERATES,
  GROUSER_CONVERGED,
  GROUSER_STUCK /* the tick needs Newton's steps, damping, another guess, a shorter step or the fallback */
};

typedef struct {
  grouser_block_rows left, right; /* right where each track has its own ground */
  grouser_block_forces forces;
  double prepared[GROUSER_MAX_PREPARED][GROUSER_BLOCK]; /* by the kernel */
  double start[3][GROUSER_BLOCK];                         /* the body at the beginning of the tick */
  double anchor[3][GROUSER_BLOCK], pull[2][GROUSER_BLOCK], load_ratio[GROUSER_BLOCK], yaw_inertia[GROUSER_BLOCK];
  double inverse[3][3][GROUSER_BLOCK];
  double step[3][GROUSER_BLOCK];                          /* the next one */
  double size[GROUSER_BLOCK], size_before[GROUSER_BLOCK]; /* of the residual, now and a step ago */
  int64_t stage[GROUSER_BLOCK], iteration[GROUSER_BLOCK], iterations[GROUSER_BLOCK];
  int64_t progress[GROUSER_BLOCK];  /* enum grouser_progress */
  int home[GROUSER_BLOCK];          /* who is in a lane */
} grouser_deck;

/* The kernel as it serves `ticks` at a time: few of them cost less one by one than as a block, to the same bits. */
GROUSER_CORE grouser_kernel grouser_deck_kernel(const grouser_kernel *kernel, int ticks);

/* Takes in the ticks of a block that are `chosen`, each in its own lane; lane l is home + l from then on. */
GROUSER_CORE void grouser_deck_enter(grouser_deck *deck, const grouser_plant *plant, const grouser_kernel *kernel,
                                     const grouser_fleet_block *block, const int64_t *chosen, int home);

/* Moves a tick to another lane, of this deck or of another one that has opened, too. */
GROUSER_CORE void grouser_deck_move(grouser_deck *from, int lane, grouser_deck *to, int free_lane,
                                    const grouser_kernel *kernel, int split);

/* Evaluates forces and slopes of lanes that have just entered, and takes the step that they ask for. Lanes that do
 * not iterate any longer are to be read and vacated. */
GROUSER_CORE void grouser_deck_open(grouser_deck *deck, const grouser_plant *plant, const grouser_kernel *kernel);

/* The same for the forces of lanes that have taken a step. */
GROUSER_CORE void grouser_deck_follow(grouser_deck *deck, const grouser_plant *plant, const grouser_kernel *kernel);

/* Writes what solved the tick of one lane. */
GROUSER_CORE void grouser_deck_read(const grouser_deck *deck, const grouser_plant *plant, int lane,
                                    grouser_block_solution *solution, int to);

#endif
