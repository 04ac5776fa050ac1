#include "grouser/fleet.h"

#include <stddef.h>

#include "threads.h"

typedef struct {
  const grouser_fleet *fleet;
  const double *commands;
  int ticks;
} round_of_ticks;

/* Whole blocks to every share, so that no two threads write to one cache line but at the ends of theirs. */
static void advance_share(void *work, int part, int parts) {
  const round_of_ticks *round = (const round_of_ticks *)work;
  const grouser_range range = grouser_share_of(round->fleet->vehicles, part, parts);
  if (range.first < range.end)
    round->fleet->advance_lanes(round->fleet, round->commands, round->ticks, range.first, range.end);
}

int grouser_fleet_blocks(int vehicles) { return vehicles / GROUSER_BLOCK + (vehicles % GROUSER_BLOCK != 0); }

grouser_range grouser_share_of(int vehicles, int part, int parts) {
  const int64_t blocks = grouser_fleet_blocks(vehicles);
  const int64_t first = GROUSER_BLOCK * (blocks * part / parts), end = GROUSER_BLOCK * (blocks * (part + 1) / parts);
  const grouser_range range = {(int)first, end < vehicles ? (int)end : vehicles};
  return range;
}

void grouser_fleet_advance(const grouser_fleet *fleet, const double *commands, int ticks, struct grouser_pool *pool) {
  round_of_ticks round = {fleet, commands, ticks};
  const int parts = grouser_pool_parts(pool, grouser_fleet_blocks(fleet->vehicles));
  if (pool)
    grouser_pool_run(pool, advance_share, parts, &round);
  else
    advance_share(&round, 0, 1);
}
