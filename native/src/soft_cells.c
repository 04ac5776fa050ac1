#include "cell_sums.h"
#include "cells.h"
#include "exponential.h"

/* Keeps a slip speed from being zero, and is less than what any is rounded by. */
static const double SOFT_TINY = 1e-300;

/* With T = t/K the time of shear over the modulus, z = |v| T: h = (1 - exp(-z))/|v|, q = (T exp(-z) - h)/v^2, and the
 * slope by T is exp(-z) v. */
typedef struct {
  grouser_row row;
  grouser_doubles decay, decay_slip, decay_slip_moment; /* sums of exp(-z), by a, by a y */
} soft_row;

GROUSER_INLINE soft_row sum_soft_row(const grouser_strip *strip, grouser_doubles across_square, grouser_doubles stretch,
                                     const int slopes, const int all) {
  const grouser_doubles none = doubles_of(0.0), one = doubles_of(1.0);
  const grouser_doubles halvings = stretch * doubles_of(GROUSER_LOG2E);
  soft_row sum = {{none, none, none, none, none, none, none, none, none}, none, none, none};
  grouser_row *row = &sum.row;
  /* The next root is begun before the sum of this one, behind which it would wait. */
  grouser_doubles next = doubles_root(across_square + doubles_of(strip->slip_square[0]));
  for (int j = 0; j < strip->count; j++) {
    const grouser_doubles slip = doubles_of(strip->slip[j]), slip_square = doubles_of(strip->slip_square[j]);
    const grouser_doubles slip_moment = doubles_of(strip->slip_moment[j]);
    const grouser_doubles size = next, per_size = one / size;
    if (j + 1 < strip->count) next = doubles_root(across_square + doubles_of(strip->slip_square[j + 1]));
    const grouser_doubles saturation = doubles_saturation(size * halvings), h = saturation * per_size;
    row->h += h;
    row->h_slip += h * slip;
    row->h_slip_moment += h * slip_moment;
    if (!slopes) continue;
    const grouser_doubles decay = one - saturation, q = (stretch * decay - h) * (per_size * per_size);
    const grouser_doubles p = h + q * slip_square;
    row->p += p;
    row->p_arm += p * doubles_of(strip->arm[j]);
    row->p_arm_square += p * doubles_of(strip->arm_square[j]);
    row->q += q;
    row->q_slip += q * slip;
    row->q_slip_moment += q * slip_moment;
    if (!all) continue;
    sum.decay += decay;
    sum.decay_slip += decay * slip;
    sum.decay_slip_moment += decay * slip_moment;
  }
  return sum;
}

GROUSER_INLINE void add_soft_stations(const grouser_track *track, const grouser_strip *strip,
                                      const grouser_stations *at, int from, const int slopes, const int weights,
                                      grouser_sums *sums) {
  const grouser_doubles x = doubles_load(&at->x[from]), across = doubles_load(&at->across[from]);
  const grouser_doubles stretch = doubles_load(&at->stretch[from]), strength = doubles_load(&at->strength[from]);
  const soft_row sum = sum_soft_row(strip, across * across + doubles_of(SOFT_TINY), stretch, slopes, weights);
  grouser_doubles unit[GROUSER_OUTPUTS];
  grouser_unit_force(&sum.row, x, across, unit);
  for (int n = 0; n < GROUSER_OUTPUTS; n++) sums->force[n] += strength * unit[n];
  if (!slopes) return;
  const grouser_matrix matrix = grouser_matrix_of(&sum.row, x, across);
  sums->slope[GROUSER_BY_VX][0] += strength * matrix.xx;
  sums->slope[GROUSER_BY_VX][1] += strength * matrix.xy;
  sums->slope[GROUSER_BY_VX][2] += strength * matrix.xm;
  sums->slope[GROUSER_BY_VY][1] += strength * matrix.yy;
  sums->slope[GROUSER_BY_VY][2] += strength * matrix.ym;
  sums->slope[GROUSER_BY_YAW_RATE][2] += strength * matrix.mm;
  if (!weights) return;
  const grouser_doubles decay_y = across * sum.decay;
  const grouser_doubles by_stretch[GROUSER_OUTPUTS] = {sum.decay_slip, decay_y, x * decay_y - sum.decay_slip_moment};
  const grouser_doubles by_belt = strength * doubles_load(&at->stretch_by_belt[from]);
  const grouser_doubles by_modulus = strength * doubles_load(&at->stretch_by_modulus[from]);
  for (int n = 0; n < GROUSER_OUTPUTS; n++) {
    sums->slope[GROUSER_BY_BELT][n] += by_belt * by_stretch[n];
    sums->slope[GROUSER_BY_MODULUS][n] += by_modulus * by_stretch[n];
  }
  grouser_add_weighted(track, at, from, unit, weights, sums);
}

GROUSER_INLINE void sum_soft_patch(const grouser_patch *patch, const int slopes, const int weights,
                                   grouser_patch_sums *sums) {
  for (int n = 0; n < patch->tracks; n++)
    for (int lane = 0; lane < GROUSER_STATIONS; lane += GROUSER_DOUBLES) {
      grouser_sums own;
      grouser_clear(slopes, weights, &own);
      for (int i = 0; i < patch->count; i++)
        add_soft_stations(&patch->track[n], &patch->strip[n], &patch->at[i], n * GROUSER_STATIONS + lane, slopes,
                          weights, &own);
      grouser_store(&own, slopes, weights, 1, lane, &sums[n]);
    }
}

void grouser_soft_cells(const grouser_patch *patch, enum grouser_wanted wanted, grouser_patch_sums *sums) {
  if (wanted == GROUSER_FORCES_WANTED)
    sum_soft_patch(patch, 0, 0, sums);
  else if (wanted == GROUSER_BODY_SLOPES_WANTED)
    sum_soft_patch(patch, GROUSER_BODY_SLOPES, 0, sums);
  else if (!patch->track->cohesive)
    sum_soft_patch(patch, GROUSER_SLOPES, GROUSER_RIGID_WEIGHTED, sums);
  else
    sum_soft_patch(patch, GROUSER_SLOPES, GROUSER_WEIGHTED, sums);
}
