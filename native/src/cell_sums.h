/* What a vector of stations adds to the sums over a patch. */
#ifndef GROUSER_CELL_SUMS_H
#define GROUSER_CELL_SUMS_H

#include "cells.h"

/* As grouser_patch_sums, while the stations of a track are summed. */
typedef struct {
  grouser_doubles force[GROUSER_OUTPUTS];
  grouser_doubles slope[GROUSER_SLOPES][GROUSER_OUTPUTS];
  grouser_doubles weighted[GROUSER_WEIGHTED][GROUSER_OUTPUTS];
} grouser_sums;

GROUSER_INLINE void grouser_clear(const int slopes, const int weights, grouser_sums *sums) {
  for (int n = 0; n < GROUSER_OUTPUTS; n++) {
    sums->force[n] = doubles_of(0.0);
    for (int by = 0; by < slopes; by++) sums->slope[by][n] = doubles_of(0.0);
    for (int w = 0; w < weights; w++) sums->weighted[w][n] = doubles_of(0.0);
  }
}

GROUSER_INLINE void grouser_store(const grouser_sums *sums, const int slopes, const int weights, const int symmetric,
                                  int lane, grouser_patch_sums *to) {
  for (int n = 0; n < GROUSER_OUTPUTS; n++) {
    doubles_store(&to->force[n][lane], sums->force[n]);
    for (int by = 0; by < slopes; by++)
      if (!grouser_mirrored(symmetric, by, n)) doubles_store(&to->slope[by][n][lane], sums->slope[by][n]);
    for (int w = 0; w < weights; w++) doubles_store(&to->weighted[w][n][lane], sums->weighted[w][n]);
  }
}

/* Adds the unit forces of stations by what the strength hangs on. */
GROUSER_INLINE void grouser_add_weighted(const grouser_track *track, const grouser_stations *at, int from,
                                         const grouser_doubles unit[GROUSER_OUTPUTS], const int weights,
                                         grouser_sums *sums) {
  const grouser_doubles share = doubles_load(&at->share[from]), share_by_ax = doubles_load(&at->share_by_ax[from]);
  for (int n = 0; n < GROUSER_OUTPUTS; n++) {
    sums->weighted[GROUSER_OF_SHARE][n] += share * unit[n];
    sums->weighted[GROUSER_OF_SHARE_SLOPE][n] += share_by_ax * unit[n];
  }
  if (weights <= GROUSER_OF_COHESION) return;
  for (int n = 0; n < GROUSER_OUTPUTS; n++)
    sums->weighted[GROUSER_OF_COHESION][n] += doubles_load(&at->cohesion[from]) * unit[n];
  if (!track->fading) return;
  for (int n = 0; n < GROUSER_OUTPUTS; n++) {
    const grouser_doubles faded = doubles_load(&at->fading[from]) * unit[n];
    sums->weighted[GROUSER_OF_FADING_SHARE][n] += share * faded;
    sums->weighted[GROUSER_OF_FADING_SHARE_SLOPE][n] += share_by_ax * faded;
  }
}

/* Sums over a row of cells. With v = (a, b) the slip velocity and h v the force against it, the slope by v is
 * h I + q v v' and what v changes in the displacement besides; y is the cell's arm across. */
typedef struct {
  grouser_doubles h, h_slip, h_slip_moment; /* of h, h a, h a y */
  grouser_doubles p, p_arm, p_arm_square;   /* of p = h + q a^2, by y and its square */
  grouser_doubles q, q_slip, q_slip_moment;
} grouser_row;

/* By the velocities alone: of the force along by vx; across by vx; and so on, the moment by the yaw rate at last. */
typedef struct {
  grouser_doubles xx, xy, xm, yy, ym, mm;
} grouser_matrix;

GROUSER_INLINE void grouser_unit_force(const grouser_row *row, grouser_doubles x, grouser_doubles across,
                                       grouser_doubles unit[GROUSER_OUTPUTS]) {
  unit[0] = row->h_slip;
  unit[1] = across * row->h;
  unit[2] = x * unit[1] - row->h_slip_moment;
}

GROUSER_INLINE grouser_matrix grouser_matrix_of(const grouser_row *row, grouser_doubles x, grouser_doubles across) {
  const grouser_doubles turning = across * row->q_slip_moment;
  grouser_matrix m;
  m.xx = row->p;
  m.xy = across * row->q_slip;
  m.xm = x * m.xy - row->p_arm;
  m.yy = row->h + across * across * row->q;
  m.ym = x * m.yy - turning;
  m.mm = x * (m.ym - turning) + row->p_arm_square;
  return m;
}

#endif
