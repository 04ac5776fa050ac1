/* Which vehicle is in which lane. A crew of vehicles is taken at a time, and all of it makes one tick before the next.
 * The ticks that the primary alone moves are solved together, then those of the fallback; those that both have a share
 * in, one by one. Decks are opened as the blocks of the crew are, and followed; as lanes converge, the ticks that are
 * left come together on fewer decks. */
#include "fleet_lanes.h"

#include <stddef.h>
#include <string.h>

#include "fleet_block.h"
#include "fleet_deck.h"

enum { DECKS = 8 };

typedef struct {
  const grouser_fleet *fleet;
  int blocks;
  grouser_fleet_block block[DECKS];
  grouser_deck deck[DECKS];
} crew;

/* Whom one kernel moves. */
typedef int64_t company[DECKS][GROUSER_BLOCK];

/* Reads and vacates the lanes of a deck that are done; returns how many go on iterating. */
static int vacate(crew *c, int d) {
  const grouser_plant *plant = c->fleet->plant;
  grouser_deck *deck = &c->deck[d];
  int left = 0;
  for (int l = 0; l < GROUSER_BLOCK; l++) {
    grouser_fleet_block *block = &c->block[deck->home[l] / GROUSER_BLOCK];
    const int home = deck->home[l] % GROUSER_BLOCK;
    if (deck->progress[l] == GROUSER_VACANT) continue;
    if (deck->progress[l] == GROUSER_ITERATES) {
      left++;
      continue;
    }
    if (deck->progress[l] == GROUSER_CONVERGED) {
      grouser_deck_read(deck, plant, l, &block->solution, home);
      block->solved[home] = 1;
    } else {
      grouser_block_solve(block, c->fleet, home);
    }
    deck->progress[l] = GROUSER_VACANT;
  }
  return left;
}

/* Brings the ticks that are left together on as few decks as they need, and returns how many. */
static int gather(crew *c, int decks, int left, const grouser_kernel *kernel) {
  const int needed = (left + GROUSER_BLOCK - 1) / GROUSER_BLOCK, split = c->fleet->plant->sampling.tracks;
  int free_lane = 0;
  for (int from = needed * GROUSER_BLOCK; from < decks * GROUSER_BLOCK; from++) {
    grouser_deck *deck = &c->deck[from / GROUSER_BLOCK];
    if (deck->progress[from % GROUSER_BLOCK] == GROUSER_VACANT) continue;
    while (c->deck[free_lane / GROUSER_BLOCK].progress[free_lane % GROUSER_BLOCK] != GROUSER_VACANT) free_lane++;
    grouser_deck *to = &c->deck[free_lane / GROUSER_BLOCK];
    grouser_deck_move(deck, from % GROUSER_BLOCK, to, free_lane % GROUSER_BLOCK, kernel, split);
  }
  return needed;
}

static int count_chosen(const int64_t *chosen) {
  int count = 0;
  for (int l = 0; l < GROUSER_BLOCK; l++) count += chosen[l] != 0;
  return count;
}

static void solve_together(crew *c, const grouser_kernel *kernel, company chosen) {
  const grouser_plant *plant = c->fleet->plant;
  int decks = 0, left = 0, ticks = 0;
  for (int b = 0; b < c->blocks; b++) ticks += count_chosen(chosen[b]);
  const grouser_kernel serving = grouser_deck_kernel(kernel, ticks);
  for (int b = 0; b < c->blocks; b++) {
    if (count_chosen(chosen[b]) == 0) continue;
    grouser_deck_enter(&c->deck[decks], plant, kernel, &c->block[b], chosen[b], b * GROUSER_BLOCK);
    grouser_deck_open(&c->deck[decks], plant, &serving);
    left += vacate(c, decks++);
  }
  while (left > 0) {
    decks = gather(c, decks, left, &serving);
    left = 0;
    for (int d = 0; d < decks; d++) {
      grouser_deck_follow(&c->deck[d], plant, &serving);
      left += vacate(c, d);
    }
  }
}

/* Splits those who have begun by the weight of the fallback; who needs both kernels is solved at once. */
static void divide(crew *c, company primary, company fallback) {
  for (int b = 0; b < c->blocks; b++)
    for (int l = 0; l < GROUSER_BLOCK; l++) {
      grouser_fleet_block *block = &c->block[b];
      const double weight = block->next_guard[l].fallback_weight;
      primary[b][l] = block->ticking[l] && weight <= 0.0;
      fallback[b][l] = block->ticking[l] && weight >= 1.0;
      if (block->ticking[l] && !primary[b][l] && !fallback[b][l]) grouser_block_solve(block, c->fleet, l);
    }
}

static void make_tick(crew *c) {
  const grouser_fleet *fleet = c->fleet;
  const grouser_plant *plant = fleet->plant;
  company primary, fallback;
  for (int b = 0; b < c->blocks; b++) {
    grouser_block_begin(&c->block[b], fleet);
    memcpy(primary[b], c->block[b].ticking, sizeof primary[b]);
  }
  if (plant->guard) divide(c, primary, fallback);
  solve_together(c, plant->kernel, primary);
  if (plant->guard) solve_together(c, plant->guard->fallback, fallback);
  for (int b = 0; b < c->blocks; b++) grouser_block_finish(&c->block[b], plant);
}

void grouser_fleet_advance_lanes(const grouser_fleet *fleet, const double *commands, int ticks, int first, int end) {
  crew c;
  c.fleet = fleet;
  while (first < end) {
    for (c.blocks = 0; c.blocks < DECKS && first < end; c.blocks++) {
      first = grouser_block_load(&c.block[c.blocks], fleet, commands, first, end);
      grouser_block_ready(&c.block[c.blocks], fleet);
    }
    for (int tick = 0; tick < ticks; tick++) make_tick(&c);
    for (int b = 0; b < c.blocks; b++) grouser_block_store(&c.block[b], fleet);
  }
}
