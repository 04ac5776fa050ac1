/* Which vehicle is in which lane. The ticks that the primary alone moves are solved on one deck, those of the fallback
 * on another, and those that both have a share in one by one. A lane begins its vehicle's next tick as soon as it has
 * solved one, and then takes the next vehicle, while the others iterate: so the decks stay full. */
#include "fleet_lanes.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "fleet_deck.h"

enum { PRIMARY_DECK, FALLBACK_DECK, DECKS, ALONE = DECKS };

typedef struct {
  int vehicle; /* or -1 */
  int wanted;  /* the deck that its tick belongs on: it waits while it is on the other */
  int ticks;   /* that are left */
  int solved;  /* whether a record was made */
  grouser_vehicle_state state;
  grouser_tick_start start;
  grouser_tick_record record;
} lane;

typedef struct {
  const grouser_fleet *fleet;
  const double *commands;
  int ticks, next, end; /* vehicles that no lane has taken yet */
  int decks;
  grouser_deck deck[DECKS];
  lane lanes[DECKS][GROUSER_BLOCK];
} crew;

static enum grouser_status finish_tick(const crew *c, lane *own, const grouser_body_step *step) {
  const enum grouser_status status =
      grouser_tick_finish(c->fleet->plant, &own->start, step->body, step->force, &own->state);
  if (status != GROUSER_SOLVED) return status;
  own->ticks--;
  own->solved = 1;
  memcpy(own->record.row, step->row, sizeof step->row);
  memcpy(own->record.force, step->force, sizeof step->force);
  own->record.iterations = step->iterations;
  own->record.divisions = step->divisions;
  own->record.detection = own->start.detection;
  return status;
}

static enum grouser_status finish_alone(const crew *c, lane *own) {
  grouser_body_step step;
  const enum grouser_status status = grouser_tick_solve(c->fleet->plant, &own->start, &own->state, &step);
  return status == GROUSER_SOLVED ? finish_tick(c, own, &step) : status;
}

static int deck_of(const grouser_plant *plant, const grouser_tick_start *start) {
  if (!plant->guard || start->guard.fallback_weight <= 0.0) return PRIMARY_DECK;
  return start->guard.fallback_weight >= 1.0 ? FALLBACK_DECK : ALONE;
}

/* Begins ticks until one wants a deck; 0 when the vehicle has none left, or is lost: the lane is free then. */
static int next_tick(const crew *c, lane *own, enum grouser_status status) {
  const grouser_fleet *fleet = c->fleet;
  while (status == GROUSER_SOLVED && own->ticks > 0) {
    status = grouser_tick_begin(fleet->plant, &fleet->grounds[own->vehicle], c->commands + 2 * own->vehicle,
                                &own->state, &own->start);
    if (status != GROUSER_SOLVED) break;
    own->wanted = deck_of(fleet->plant, &own->start);
    if (own->wanted != ALONE) return 1;
    status = finish_alone(c, own);
  }
  if (own->solved) grouser_fleet_store(fleet, own->vehicle, &own->state, &own->record);
  fleet->status[own->vehicle] = (unsigned char)status;
  own->vehicle = -1;
  return 0;
}

/* Gives a free lane the next vehicle that has a tick for a deck; 0 if there is none. */
static int take_vehicle(crew *c, lane *own) {
  while (c->next < c->end) {
    own->vehicle = c->next++;
    if (c->fleet->status[own->vehicle] != GROUSER_SOLVED) continue;
    own->ticks = c->ticks;
    own->solved = 0;
    grouser_fleet_load(c->fleet, own->vehicle, &own->state);
    own->start.traits = &c->fleet->traits[own->vehicle];
    own->start.cosine = cos(own->state.heading);
    own->start.sine = sin(own->state.heading);
    if (next_tick(c, own, GROUSER_SOLVED)) return 1;
  }
  own->vehicle = -1;
  return 0;
}

static void enter(crew *c, int d, int l) {
  const lane *own = &c->lanes[d][l];
  if (own->vehicle >= 0 && own->wanted == d) grouser_deck_enter(&c->deck[d], l, &own->start);
}

/* A lane of a deck that is free, or whose tick belongs on the other one; -1 if all are at work. */
static int idle_lane(const crew *c, int d) {
  for (int l = 0; l < GROUSER_BLOCK; l++)
    if (!c->deck[d].active[l]) return l;
  return -1;
}

/* Brings waiting lanes to the deck that they want as far as there is room, and new vehicles into free lanes. */
static void settle(crew *c) {
  int moved = 1;
  while (moved) {
    moved = 0;
    for (int d = 0; c->decks > 1 && d < DECKS; d++)
      for (int l = 0; l < GROUSER_BLOCK; l++) {
        const int other = 1 - d;
        if (c->lanes[d][l].vehicle < 0 || c->lanes[d][l].wanted == d) continue;
        const int room = idle_lane(c, other);
        if (room < 0) continue;
        const lane guest = c->lanes[d][l];
        c->lanes[d][l] = c->lanes[other][room];
        c->lanes[other][room] = guest;
        enter(c, d, l);
        enter(c, other, room);
        moved = 1;
      }
    for (int l = 0; l < GROUSER_BLOCK; l++)
      if (c->lanes[PRIMARY_DECK][l].vehicle < 0 && take_vehicle(c, &c->lanes[PRIMARY_DECK][l])) {
        enter(c, PRIMARY_DECK, l);
        moved = 1;
      }
  }
}

static int at_work(const crew *c, int d) {
  int count = 0;
  for (int l = 0; l < GROUSER_BLOCK; l++) count += c->deck[d].active[l];
  return count;
}

/* Evaluates a deck and takes every lane on it one step on; 1 if a lane came free, or wants the other deck. */
static int advance_deck(crew *c, int d) {
  const grouser_plant *plant = c->fleet->plant;
  int unsettled = 0;
  grouser_deck_evaluate(&c->deck[d], plant);
  for (int l = 0; l < GROUSER_BLOCK; l++) {
    if (!c->deck[d].active[l]) continue;
    lane *own = &c->lanes[d][l];
    grouser_body_step step;
    const enum grouser_progress progress = grouser_deck_proceed(&c->deck[d], plant, l, &own->start, &step);
    if (progress == GROUSER_ITERATES) continue;
    const enum grouser_status status =
        progress == GROUSER_CONVERGED ? finish_tick(c, own, &step) : finish_alone(c, own);
    if (next_tick(c, own, status) && own->wanted == d)
      grouser_deck_enter(&c->deck[d], l, &own->start);
    else
      unsettled = 1;
  }
  return unsettled;
}

void grouser_fleet_advance_range(const grouser_fleet *fleet, const double *commands, int ticks, int first, int end) {
  crew c;
  c.fleet = fleet;
  c.commands = commands;
  c.ticks = ticks;
  c.next = first;
  c.end = end;
  c.decks = fleet->plant->guard ? 2 : 1;
  for (int d = 0; d < c.decks; d++) {
    memset(&c.deck[d], 0, sizeof c.deck[d]);
    memset(c.lanes[d], 0, sizeof c.lanes[d]);
    c.deck[d].kernel = d == PRIMARY_DECK ? fleet->plant->kernel : fleet->plant->guard->fallback;
    for (int l = 0; l < GROUSER_BLOCK; l++) c.lanes[d][l].vehicle = -1;
  }
  settle(&c);
  for (;;) {
    const int primary = at_work(&c, PRIMARY_DECK), fallback = c.decks > 1 ? at_work(&c, FALLBACK_DECK) : 0;
    if (primary + fallback == 0) return;
    /* A full deck, or the fuller one: the other waits for company. */
    const int d = fallback == GROUSER_BLOCK || fallback > primary ? FALLBACK_DECK : PRIMARY_DECK;
    if (advance_deck(&c, d)) settle(&c);
  }
}
