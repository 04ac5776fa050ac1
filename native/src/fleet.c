#include "grouser/fleet.h"

#include <stddef.h>

#include "threads.h"

typedef struct {
  const grouser_fleet *fleet;
  const double *commands;
  int ticks;
} round_of_ticks;

/* Whole blocks to every thread, so that no two write to one cache line but at the ends of their shares. */
static void advance_share(void *work, int part, int parts) {
  const round_of_ticks *round = (const round_of_ticks *)work;
  const int vehicles = round->fleet->vehicles;
  const int blocks = vehicles / GROUSER_BLOCK + (vehicles % GROUSER_BLOCK != 0);
  const int each = blocks / parts, more = blocks % parts;
  const int first = part * each + (part < more ? part : more);
  const int last = first + each + (part < more);
  /* In vehicles; the product stays below the number of vehicles but for the last block. */
  const int end = last == blocks ? vehicles : last * GROUSER_BLOCK;
  if (first < last) round->fleet->advance_lanes(round->fleet, round->commands, round->ticks, first * GROUSER_BLOCK, end);
}

void grouser_fleet_advance(const grouser_fleet *fleet, const double *commands, int ticks, struct grouser_pool *pool) {
  round_of_ticks round = {fleet, commands, ticks};
  if (pool)
    grouser_pool_run(pool, advance_share, &round);
  else
    advance_share(&round, 0, 1);
}
