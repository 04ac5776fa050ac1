/* Which vehicle is in which lane. A crew of vehicles is taken at a time, and all of it makes one tick before the next.
 * The ticks that the primary alone moves are solved together, then those of the fallback; those that both have a share
 * in, one by one. Decks are opened with all their lanes full, and followed; as lanes converge, the ticks that are left
 * come together on fewer decks. */
#include "fleet_lanes.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "fleet_deck.h"

enum { DECKS = 8, CREW = DECKS * GROUSER_BLOCK };

typedef struct {
  int vehicle;
  enum grouser_status status;
  int solved; /* whether a record was made */
  grouser_vehicle_state state;
  grouser_tick_start start;
  grouser_tick_record record;
} member;

/* Members whose ticks one kernel moves. */
typedef struct {
  const grouser_kernel *kernel;
  int count;
  int member[CREW];
} company;

typedef struct {
  const grouser_fleet *fleet;
  int count;
  member members[CREW];
  grouser_deck deck[DECKS];
  int seated[DECKS][GROUSER_BLOCK]; /* which member is in a lane */
} crew;

static void finish_tick(const grouser_plant *plant, member *own, const grouser_body_step *step) {
  own->status = grouser_tick_finish(plant, &own->start, step->body, step->force, &own->state);
  if (own->status != GROUSER_SOLVED) return;
  own->solved = 1;
  memcpy(own->record.row, step->row, sizeof step->row);
  memcpy(own->record.force, step->force, sizeof step->force);
  own->record.iterations = step->iterations;
  own->record.divisions = step->divisions;
  own->record.detection = own->start.detection;
}

static void finish_alone(const grouser_plant *plant, member *own) {
  grouser_body_step step;
  own->status = grouser_tick_solve(plant, &own->start, &own->state, &step);
  if (own->status == GROUSER_SOLVED) finish_tick(plant, own, &step);
}

/* Takes every lane of a deck that has been evaluated one step on; returns how many go on iterating. */
static int proceed(crew *c, int d) {
  const grouser_plant *plant = c->fleet->plant;
  int left = 0;
  for (int l = 0; l < GROUSER_BLOCK; l++) {
    if (!c->deck[d].active[l]) continue;
    member *own = &c->members[c->seated[d][l]];
    grouser_body_step step;
    const enum grouser_progress progress = grouser_deck_proceed(&c->deck[d], plant, l, &own->start, &step);
    if (progress == GROUSER_CONVERGED) finish_tick(plant, own, &step);
    if (progress == GROUSER_STUCK) finish_alone(plant, own);
    left += progress == GROUSER_ITERATES;
  }
  return left;
}

static int decks_for(int ticks) { return (ticks + GROUSER_BLOCK - 1) / GROUSER_BLOCK; }

/* Brings the ticks that are left together on as few decks as they need, and returns how many. */
static int gather(crew *c, int decks, int left, const grouser_kernel *kernel) {
  const int needed = decks_for(left), split = c->fleet->plant->sampling.tracks;
  int free_lane = 0;
  for (int from = needed * GROUSER_BLOCK; from < decks * GROUSER_BLOCK; from++) {
    grouser_deck *deck = &c->deck[from / GROUSER_BLOCK];
    if (!deck->active[from % GROUSER_BLOCK]) continue;
    while (c->deck[free_lane / GROUSER_BLOCK].active[free_lane % GROUSER_BLOCK]) free_lane++;
    const int d = free_lane / GROUSER_BLOCK, l = free_lane % GROUSER_BLOCK;
    grouser_deck_move(deck, from % GROUSER_BLOCK, &c->deck[d], l, kernel, split);
    c->seated[d][l] = c->seated[from / GROUSER_BLOCK][from % GROUSER_BLOCK];
  }
  return needed;
}

static void solve_together(crew *c, const company *ticks) {
  const grouser_plant *plant = c->fleet->plant;
  const int columns = ticks->kernel->columns;
  int decks = decks_for(ticks->count), left = 0;
  for (int d = 0; d < decks; d++) {
    for (int l = 0; l < GROUSER_BLOCK && d * GROUSER_BLOCK + l < ticks->count; l++) {
      c->seated[d][l] = ticks->member[d * GROUSER_BLOCK + l];
      grouser_deck_enter(&c->deck[d], plant, columns, l, &c->members[c->seated[d][l]].start);
    }
    grouser_deck_open(&c->deck[d], plant, ticks->kernel);
    left += proceed(c, d);
  }
  while (left > 0) {
    decks = gather(c, decks, left, ticks->kernel);
    left = 0;
    for (int d = 0; d < decks; d++) {
      grouser_deck_follow(&c->deck[d], plant, ticks->kernel);
      left += proceed(c, d);
    }
  }
}

static void make_tick(crew *c, const double *commands) {
  const grouser_fleet *fleet = c->fleet;
  const grouser_plant *plant = fleet->plant;
  company primary, fallback;
  primary.kernel = plant->kernel;
  fallback.kernel = plant->guard ? plant->guard->fallback : NULL;
  primary.count = fallback.count = 0;
  for (int m = 0; m < c->count; m++) {
    member *own = &c->members[m];
    if (own->status != GROUSER_SOLVED) continue;
    own->status = grouser_tick_begin(plant, &fleet->grounds[own->vehicle], commands + 2 * own->vehicle, &own->state,
                                     &own->start);
    if (own->status != GROUSER_SOLVED) continue;
    if (!plant->guard || own->start.guard.fallback_weight <= 0.0)
      primary.member[primary.count++] = m;
    else if (own->start.guard.fallback_weight >= 1.0)
      fallback.member[fallback.count++] = m;
    else
      finish_alone(plant, own);
  }
  solve_together(c, &primary);
  if (plant->guard) solve_together(c, &fallback);
}

/* Fills a crew with vehicles that are not lost; returns the first that it has no room for. */
static int gather_crew(crew *c, int first, int end) {
  c->count = 0;
  for (; first < end && c->count < CREW; first++) {
    if (c->fleet->status[first] != GROUSER_SOLVED) continue;
    member *own = &c->members[c->count++];
    own->vehicle = first;
    own->status = GROUSER_SOLVED;
    own->solved = 0;
    memset(&own->start, 0, sizeof own->start);
    grouser_fleet_load(c->fleet, first, &own->state);
    own->start.traits = &c->fleet->traits[first];
    own->start.cosine = cos(own->state.heading);
    own->start.sine = sin(own->state.heading);
  }
  return first;
}

static void dismiss_crew(const crew *c) {
  for (int m = 0; m < c->count; m++) {
    const member *own = &c->members[m];
    if (own->solved) grouser_fleet_store(c->fleet, own->vehicle, &own->state, &own->record);
    c->fleet->status[own->vehicle] = (unsigned char)own->status;
  }
}

void grouser_fleet_advance_range(const grouser_fleet *fleet, const double *commands, int ticks, int first, int end) {
  crew c;
  c.fleet = fleet;
  memset(c.deck, 0, sizeof c.deck[0] * (size_t)decks_for(end - first < CREW ? end - first : CREW));
  while (first < end) {
    first = gather_crew(&c, first, end);
    for (int tick = 0; tick < ticks; tick++) make_tick(&c, commands);
    dismiss_crew(&c);
  }
}
