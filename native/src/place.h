/* Where the cells of a row's tracks are, how they move and what they carry. */
#ifndef GROUSER_PLACE_H
#define GROUSER_PLACE_H

#include <math.h>

#include "cells.h"
#include "load.h"

static inline double grouser_side_sign(enum grouser_side side) { return side == GROUSER_LEFT ? 1.0 : -1.0; }

static inline void grouser_lay_out(const grouser_physics *block, grouser_layout *l) {
  const double count = block->wheels, spacing = block->element_spacing, gravity = block->gravity;
  const double spread = spacing * spacing * (count * (count * count - 1) / 12);
  const double per_spread = spread > 0 ? 1.0 / (spread * gravity) : 0.0;
  l->count = block->wheels * block->along;
  l->along = block->along;
  l->per_along = 1.0 / block->along;
  l->per_cells = l->per_along / block->across;
  l->step = block->element_length * l->per_along;
  l->spacing = spacing;
  l->half = block->element_length / 2;
  l->middle = (count - 1) / 2;
  l->center = block->contact_center;
  l->reach = block->contact == GROUSER_CONTINUOUS ? 1.0 : 0.0;
  l->mean_share = 1.0 / count;
  l->lean = -block->contact_center * gravity * per_spread;
  l->lean_by_ax = -block->cg_height * per_spread;
}

/* Shares lie on a line over the elements, so that the outermost say whether any is negative. */
static inline void grouser_share_load(const grouser_physics *block, const grouser_layout *layout, double ax,
                                      grouser_track *t) {
  t->lean = layout->lean + layout->lean_by_ax * ax;
  t->lean_by_ax = layout->lean_by_ax;
  t->per_total = 1.0;
  t->total_by_ax = 0;
  const double least = layout->mean_share - fabs(t->lean) * (layout->middle * layout->spacing);
  if (least < 0) {
    double total = 0;
    for (int i = 0; i < block->wheels; i++) {
      const double arm = grouser_element_arm(block, i), share = layout->mean_share + arm * t->lean;
      total += share > 0 ? share : 0.0;
      t->total_by_ax += share > 0 ? arm * t->lean_by_ax : 0.0;
    }
    t->per_total = 1.0 / total;
  }
  t->fading = t->cohesive && (least > 0 ? least : 0.0) * t->full_contacts < 1;
}

static inline void grouser_find_track(const grouser_physics *block, const grouser_layout *layout, const double *x,
                                      enum grouser_side side, grouser_track *t) {
  const double *terrain = x + GROUSER_TERRAIN, sign = grouser_side_sign(side), per_cells = layout->per_cells;
  const double belt = x[side == GROUSER_LEFT ? GROUSER_V_LEFT : GROUSER_V_RIGHT];
  const double soft_square = block->soft_speed * block->soft_speed, soft_belt = sqrt(belt * belt + soft_square);
  const double per_soft_belt = 1.0 / soft_belt;
  const double travel = block->contact == GROUSER_CONTINUOUS ? block->contact_length : block->element_length;
  t->vy = sign * x[GROUSER_VY];
  t->yaw_rate = sign * x[GROUSER_YAW_RATE];
  t->belt = belt;
  t->slip = x[GROUSER_VX] - t->yaw_rate * (block->tread / 2) - belt;
  t->modulus = x[grouser_columns(block->mode) - 1];
  const double per_meter = 1.0 / (soft_belt * t->modulus);
  t->direction = belt * per_soft_belt;
  t->direction_slope = soft_square * (per_soft_belt * per_soft_belt * per_soft_belt);
  t->stretch = travel / 2 * per_meter;
  t->stretch_slope = t->direction * per_meter;
  t->slope_by_belt = -t->direction_slope * per_meter;
  t->fall_by_belt = t->direction * per_soft_belt;
  t->load = grouser_side_load(block, x[GROUSER_AY], side, &t->load_by_ay);
  t->cohesive = block->mode == GROUSER_SOIL;
  t->cohesion = t->full_contacts = t->per_full_contact = 0;
  if (t->cohesive) {
    t->cohesion = terrain[0] * (block->element_length * block->track_width * per_cells);
    t->per_full_contact = 2 * block->wheels / (GROUSER_COHESION_FADE * block->mass * block->gravity);
    t->full_contacts = t->load * t->per_full_contact;
  }
  t->friction = (t->cohesive ? grouser_friction_tangent(block, terrain) : terrain[0]) * per_cells;
  t->strength = t->friction * t->load;
  grouser_share_load(block, layout, x[GROUSER_AX], t);
}

static inline void grouser_fill_strip(const grouser_physics *block, const grouser_track *t, int first,
                                      grouser_strip *strip) {
  const double step = block->track_width / block->across, half = block->track_width / 2;
  strip->count = block->across - first < GROUSER_STRIP ? block->across - first : GROUSER_STRIP;
  for (int j = 0; j < strip->count; j++) {
    const double arm = (first + j + 0.5) * step - half, slip = t->slip - t->yaw_rate * arm;
    strip->arm[j] = arm;
    strip->arm_square[j] = arm * arm;
    strip->slip[j] = slip;
    strip->slip_square[j] = slip * slip;
    strip->slip_moment[j] = slip * arm;
  }
}

/* Share 1/n + arm lean of the track's load, at least 0, over the sum of the shares; strength by the load N, as that of
 * c min(1, N/N_c) + p tan(phi). */
GROUSER_INLINE void grouser_place_load(const grouser_layout *layout, const grouser_track *track, grouser_doubles arm,
                                       grouser_doubles weight, const int all, int lane, grouser_stations *to) {
  const grouser_doubles none = doubles_of(0.0), one = doubles_of(1.0), per_total = doubles_of(track->per_total);
  const grouser_doubles raw = doubles_of(layout->mean_share) + arm * doubles_of(track->lean);
  const grouser_doubles share = weight * (doubles_most(raw, none) * per_total);
  grouser_doubles strength = share * doubles_of(track->strength);
  if (track->cohesive) {
    const grouser_doubles contact = share * doubles_of(track->full_contacts);
    const grouser_doubles cohesion = weight * doubles_least(contact, one);
    strength += cohesion * doubles_of(track->cohesion);
    if (all) {
      doubles_store(&to->cohesion[lane], cohesion);
      doubles_store(&to->fading[lane], doubles_where_less(contact, one, one, none));
    }
  }
  doubles_store(&to->strength[lane], strength);
  if (!all) return;
  const grouser_doubles own = doubles_where_less(none, raw, arm * doubles_of(track->lean_by_ax), none);
  doubles_store(&to->share[lane], share);
  doubles_store(&to->share_by_ax[lane], (weight * own - share * doubles_of(track->total_by_ax)) * per_total);
}

/* Finds eight stations from `first`; those past the last are the last one's, without strength. */
GROUSER_INLINE void grouser_place_stations(const grouser_layout *layout, const grouser_track *track, int tracks,
                                           int first, const int all, grouser_stations *to) {
  const grouser_doubles half = doubles_of(0.5), one = doubles_of(1.0), shift = doubles_of(6755399441055744.0);
  const grouser_doubles count = doubles_of(layout->count), along = doubles_of(layout->along);
  GROUSER_UNROLL
  for (int l = 0; l < GROUSER_STATIONS; l += GROUSER_DOUBLES) {
    const grouser_doubles number = doubles_counted_from(first + l), kept = doubles_least(number, count - one);
    const grouser_doubles weight = doubles_least(doubles_most(count - number, doubles_of(0.0)), one);
    /* The middle of a station's place lies well within its element: rounding finds the element. */
    const grouser_doubles element = ((kept + half) * doubles_of(layout->per_along) - half + shift) - shift;
    const grouser_doubles place = kept - element * along + half;
    const grouser_doubles offset = place * doubles_of(layout->step) - doubles_of(layout->half);
    const grouser_doubles arm = (element - doubles_of(layout->middle)) * doubles_of(layout->spacing);
    const grouser_doubles ahead = offset + doubles_of(layout->reach) * arm;
    const grouser_doubles x = offset + arm + doubles_of(layout->center);
    for (int n = 0; n < tracks; n++) {
      const grouser_track *t = &track[n];
      const int lane = n * GROUSER_STATIONS + l;
      const grouser_doubles stretch = doubles_of(t->stretch) - doubles_of(t->stretch_slope) * ahead;
      doubles_store(&to->x[lane], x);
      doubles_store(&to->across[lane], doubles_of(t->vy) + doubles_of(t->yaw_rate) * x);
      doubles_store(&to->stretch[lane], stretch);
      grouser_place_load(layout, t, arm, weight, all, lane, to);
      if (!all) continue;
      doubles_store(&to->stretch_by_belt[lane],
                    doubles_of(t->slope_by_belt) * ahead - stretch * doubles_of(t->fall_by_belt));
      doubles_store(&to->stretch_by_modulus[lane], stretch * doubles_of(-1.0 / t->modulus));
    }
  }
}

/* Places at most GROUSER_RUN times eight stations, and returns how many times. */
GROUSER_INLINE int grouser_place_those(const grouser_layout *layout, const grouser_track *track, const int tracks,
                                       int first, const int all, grouser_stations *at) {
  /* Own copies, which no station that is written can change. */
  const grouser_layout own_layout = *layout;
  const grouser_track own_track[2] = {track[0], track[tracks - 1]};
  const int left = (own_layout.count - first + GROUSER_STATIONS - 1) / GROUSER_STATIONS;
  const int count = left < GROUSER_RUN ? left : GROUSER_RUN;
  for (int i = 0; i < count; i++)
    grouser_place_stations(&own_layout, own_track, tracks, first + i * GROUSER_STATIONS, all, &at[i]);
  return count;
}

static inline int grouser_place_run(const grouser_layout *layout, const grouser_track *track, int tracks, int first,
                                    int all, grouser_stations *at) {
  if (all) return grouser_place_those(layout, track, tracks, first, 1, at);
  return tracks == 1 ? grouser_place_those(layout, track, 1, first, 0, at)
                     : grouser_place_those(layout, track, 2, first, 0, at);
}

#endif
