#include <math.h>

#include "cells.h"
#include "exponential.h"

/* As soft_cells.c in float32, stations of both tracks side by side in sixteen lanes. Places, slip, contact time and
 * load are found in float64, so that what float32 rounds is of the size of a cell's own share. */

/* Keeps a slip speed from being zero, and is less than any that matters. */
static const float SINGLE_TINY = 1e-30f;

enum { SINGLE_LANES = GROUSER_BOTH };

GROUSER_INLINE grouser_lanes lanes_root(grouser_lanes a) {
#if defined(__GNUC__) && defined(__AVX512F__)
  return (grouser_lanes)_mm512_maskz_sqrt_ps(GROUSER_EVERY_FLOAT, (__m512)a);
#elif defined(__GNUC__) && defined(__AVX2__) && defined(__FMA__)
  return (grouser_lanes)_mm256_sqrt_ps((__m256)a);
#else
  float lane[GROUSER_FLOATS];
  lanes_store(lane, a);
  for (int l = 0; l < GROUSER_FLOATS; l++) lane[l] = sqrtf(lane[l]);
  return lanes_load(lane);
#endif
}

GROUSER_INLINE grouser_lanes root_of(const float *slip, grouser_lanes across_square) {
  return lanes_root(lanes_fma(lanes_load(slip), lanes_load(slip), across_square));
}

GROUSER_INLINE grouser_lanes lanes_narrowed(const double *from) {
#if defined(__GNUC__) && defined(__AVX512F__)
  const __m256 low = _mm512_maskz_cvtpd_ps(GROUSER_EVERY, _mm512_loadu_pd(from));
  const __m256 high = _mm512_maskz_cvtpd_ps(GROUSER_EVERY, _mm512_loadu_pd(from + 8));
  return (grouser_lanes)_mm512_castpd_ps(_mm512_maskz_insertf64x4(
      GROUSER_EVERY, _mm512_castpd256_pd512(_mm256_castps_pd(low)), _mm256_castps_pd(high), 1));
#else
  float lane[GROUSER_FLOATS];
  for (int l = 0; l < GROUSER_FLOATS; l++) lane[l] = (float)from[l];
  return lanes_load(lane);
#endif
}

typedef struct {
  GROUSER_ALIGNED float slip[GROUSER_STRIP][SINGLE_LANES], slip_moment[GROUSER_STRIP][SINGLE_LANES];
  float arm[GROUSER_STRIP], arm_square[GROUSER_STRIP];
  int count;
} single_strip;

static void narrow_strips(const grouser_strip *strip, single_strip *to) {
  to->count = strip->count;
  for (int j = 0; j < strip->count; j++) {
    to->arm[j] = (float)strip->arm[j];
    to->arm_square[j] = (float)strip->arm_square[j];
    for (int l = 0; l < SINGLE_LANES; l++) {
      const grouser_strip *own = &strip[l >= GROUSER_STATIONS];
      to->slip[j][l] = (float)own->slip[j];
      to->slip_moment[j][l] = (float)own->slip_moment[j];
    }
  }
}

typedef struct {
  grouser_lanes force[GROUSER_OUTPUTS];
  grouser_lanes slope[GROUSER_SLOPES][GROUSER_OUTPUTS];
  grouser_lanes weighted[GROUSER_WEIGHTED][GROUSER_OUTPUTS];
} single_sums;

GROUSER_INLINE void lanes_accumulate(grouser_lanes *sum, grouser_lanes a, grouser_lanes b) {
  *sum = lanes_fma(a, b, *sum);
}

GROUSER_INLINE void add_single_stations(const single_strip *strip, const grouser_stations *at, int lane, int fading,
                                        const int slopes, const int weights, single_sums *sums) {
  const grouser_lanes none = lanes_of(0.0f), one = lanes_of(1.0f);
  const grouser_lanes x = lanes_narrowed(&at->x[lane]), across = lanes_narrowed(&at->across[lane]);
  const grouser_lanes stretch = lanes_narrowed(&at->stretch[lane]), strength = lanes_narrowed(&at->strength[lane]);
  const grouser_lanes across_square = lanes_fma(across, across, lanes_of(SINGLE_TINY));
  const grouser_lanes halvings = stretch * lanes_of((float)GROUSER_LOG2E);
  grouser_lanes h_sum = none, h_slip = none, h_slip_moment = none, p_sum = none, p_arm = none, p_arm_square = none;
  grouser_lanes q_sum = none, q_slip = none, q_slip_moment = none;
  grouser_lanes decay_sum = none, decay_slip = none, decay_slip_moment = none;
  grouser_lanes next = root_of(strip->slip[0] + lane, across_square);
  for (int j = 0; j < strip->count; j++) {
    const grouser_lanes slip = lanes_load(&strip->slip[j][lane]);
    const grouser_lanes slip_moment = lanes_load(&strip->slip_moment[j][lane]);
    const grouser_lanes size = next, per_size = one / size;
    if (j + 1 < strip->count) next = root_of(strip->slip[j + 1] + lane, across_square);
    const grouser_lanes saturation = lanes_saturation(size * halvings), h = saturation * per_size;
    h_sum += h;
    h_slip = lanes_fma(h, slip, h_slip);
    h_slip_moment = lanes_fma(h, slip_moment, h_slip_moment);
    if (!slopes) continue;
    const grouser_lanes decay = one - saturation, q = (stretch * decay - h) * (per_size * per_size);
    const grouser_lanes q_of_slip = q * slip, p = lanes_fma(q_of_slip, slip, h);
    p_sum += p;
    p_arm = lanes_fma(p, lanes_of(strip->arm[j]), p_arm);
    p_arm_square = lanes_fma(p, lanes_of(strip->arm_square[j]), p_arm_square);
    q_sum += q;
    q_slip += q_of_slip;
    q_slip_moment = lanes_fma(q, slip_moment, q_slip_moment);
    if (!weights) continue;
    decay_sum += decay;
    decay_slip = lanes_fma(decay, slip, decay_slip);
    decay_slip_moment = lanes_fma(decay, slip_moment, decay_slip_moment);
  }
  const grouser_lanes force_y = across * h_sum;
  const grouser_lanes unit[GROUSER_OUTPUTS] = {h_slip, force_y, x * force_y - h_slip_moment};
  for (int n = 0; n < GROUSER_OUTPUTS; n++) lanes_accumulate(&sums->force[n], strength, unit[n]);
  if (!slopes) return;
  const grouser_lanes xy = across * q_slip, yy = lanes_fma(across * across, q_sum, h_sum);
  const grouser_lanes across_moment = across * q_slip_moment, ym = x * yy - across_moment;
  const grouser_lanes mm = x * (ym - across_moment) + p_arm_square;
  lanes_accumulate(&sums->slope[GROUSER_BY_VX][0], strength, p_sum);
  lanes_accumulate(&sums->slope[GROUSER_BY_VX][1], strength, xy);
  lanes_accumulate(&sums->slope[GROUSER_BY_VX][2], strength, x * xy - p_arm);
  lanes_accumulate(&sums->slope[GROUSER_BY_VY][1], strength, yy);
  lanes_accumulate(&sums->slope[GROUSER_BY_VY][2], strength, ym);
  lanes_accumulate(&sums->slope[GROUSER_BY_YAW_RATE][2], strength, mm);
  if (!weights) return;
  const grouser_lanes decay_y = across * decay_sum;
  const grouser_lanes by_stretch[GROUSER_OUTPUTS] = {decay_slip, decay_y, x * decay_y - decay_slip_moment};
  const grouser_lanes by_belt = strength * lanes_narrowed(&at->stretch_by_belt[lane]);
  const grouser_lanes by_modulus = strength * lanes_narrowed(&at->stretch_by_modulus[lane]);
  const grouser_lanes share = lanes_narrowed(&at->share[lane]), share_by_ax = lanes_narrowed(&at->share_by_ax[lane]);
  for (int n = 0; n < GROUSER_OUTPUTS; n++) {
    lanes_accumulate(&sums->slope[GROUSER_BY_BELT][n], by_belt, by_stretch[n]);
    lanes_accumulate(&sums->slope[GROUSER_BY_MODULUS][n], by_modulus, by_stretch[n]);
    lanes_accumulate(&sums->weighted[GROUSER_OF_SHARE][n], share, unit[n]);
    lanes_accumulate(&sums->weighted[GROUSER_OF_SHARE_SLOPE][n], share_by_ax, unit[n]);
    if (weights <= GROUSER_OF_COHESION) continue;
    lanes_accumulate(&sums->weighted[GROUSER_OF_COHESION][n], lanes_narrowed(&at->cohesion[lane]), unit[n]);
    if (!fading) continue;
    const grouser_lanes faded = lanes_narrowed(&at->fading[lane]) * unit[n];
    lanes_accumulate(&sums->weighted[GROUSER_OF_FADING_SHARE][n], share, faded);
    lanes_accumulate(&sums->weighted[GROUSER_OF_FADING_SHARE_SLOPE][n], share_by_ax, faded);
  }
}

/* Stores the lanes of each track apart. */
GROUSER_INLINE void widen(grouser_lanes sum, int lane, double *left, double *right) {
  float one[GROUSER_FLOATS];
  lanes_store(one, sum);
  for (int l = 0; l < GROUSER_FLOATS; l++)
    *(lane + l < GROUSER_STATIONS ? &left[lane + l] : &right[lane + l - GROUSER_STATIONS]) = (double)one[l];
}

GROUSER_INLINE void sum_single_patch(const grouser_patch *patch, const int slopes, const int weights,
                                     grouser_patch_sums *sums) {
  const int fading = patch->track[0].fading || patch->track[1].fading;
  single_strip strip;
  narrow_strips(patch->strip, &strip);
  for (int lane = 0; lane < SINGLE_LANES; lane += GROUSER_FLOATS) {
    single_sums own;
    for (int n = 0; n < GROUSER_OUTPUTS; n++) {
      own.force[n] = lanes_of(0.0f);
      for (int by = 0; by < slopes; by++) own.slope[by][n] = lanes_of(0.0f);
      for (int w = 0; w < weights; w++) own.weighted[w][n] = lanes_of(0.0f);
    }
    for (int i = 0; i < patch->count; i++)
      add_single_stations(&strip, &patch->at[i], lane, fading, slopes, weights, &own);
    for (int n = 0; n < GROUSER_OUTPUTS; n++) {
      widen(own.force[n], lane, sums[0].force[n], sums[1].force[n]);
      for (int by = 0; by < slopes; by++)
        if (!grouser_mirrored(1, by, n)) widen(own.slope[by][n], lane, sums[0].slope[by][n], sums[1].slope[by][n]);
      for (int w = 0; w < weights; w++)
        widen(own.weighted[w][n], lane, sums[0].weighted[w][n], sums[1].weighted[w][n]);
    }
  }
}

void grouser_single_cells(const grouser_patch *patch, enum grouser_wanted wanted, grouser_patch_sums *sums) {
  if (wanted == GROUSER_FORCES_WANTED)
    sum_single_patch(patch, 0, 0, sums);
  else if (wanted == GROUSER_BODY_SLOPES_WANTED)
    sum_single_patch(patch, GROUSER_BODY_SLOPES, 0, sums);
  else if (!patch->track->cohesive)
    sum_single_patch(patch, GROUSER_SLOPES, GROUSER_RIGID_WEIGHTED, sums);
  else
    sum_single_patch(patch, GROUSER_SLOPES, GROUSER_WEIGHTED, sums);
}
