#include "grouser/guard.h"

#include <math.h>
#include <stddef.h>

grouser_guard_state grouser_guard_fresh(void) {
  const grouser_guard_state state = {GROUSER_PRIMARY, 0, 0, INFINITY, INFINITY, 0.0};
  return state;
}

static int votes(uint32_t flags) {
  int count = 0;
  for (; flags; flags &= flags - 1) count++;
  return count;
}

grouser_guard_state grouser_guard_advance(const grouser_switching_policy *policy, const grouser_guard_state *state,
                                          const grouser_detection *detection, double elapsed) {
  const uint32_t window = UINT32_MAX >> (GROUSER_MAX_ENTRY_WINDOW - policy->entry_window);
  const int forced = detection->reason == GROUSER_FINITE || detection->reason == GROUSER_BOX;
  const double step = 1.0 / policy->blend_samples;
  grouser_guard_state next = *state;
  next.calm = detection->score < policy->exit_score ? state->calm + elapsed : 0.0;
  next.flags = (state->flags << 1 | (uint32_t)grouser_out_of_distribution(detection)) & window;
  next.samples = state->samples < policy->entry_window ? state->samples + 1 : policy->entry_window;
  next.dwell = state->dwell + elapsed;
  if (state->mode == GROUSER_PRIMARY && (forced || votes(next.flags) >= policy->entry_votes)) {
    next.mode = GROUSER_FALLBACK;
    next.dwell = 0.0;
  } else if (state->mode == GROUSER_FALLBACK && next.calm >= policy->exit_time &&
             next.dwell >= policy->minimum_dwell) {
    next.mode = GROUSER_PRIMARY;
    next.dwell = 0.0;
  }
  if (next.mode == GROUSER_FALLBACK)
    next.fallback_weight = forced ? 1.0 : fmin(1.0, state->fallback_weight + step);
  else
    next.fallback_weight = fmax(0.0, state->fallback_weight - step);
  return next;
}

void grouser_kernel_forces(const grouser_kernel *kernel, const double *left, const double *right,
                           enum grouser_slopes_wanted wanted, double forces[GROUSER_OUTPUTS],
                           double slopes[GROUSER_OUTPUTS][3]) {
  const int columns = kernel->columns;
  double jacobian[GROUSER_OUTPUTS * GROUSER_MAX_COLUMNS], other_jacobian[GROUSER_OUTPUTS * GROUSER_MAX_COLUMNS];
  double other[GROUSER_OUTPUTS];
  if (kernel->refuses(kernel->self, left) || (right && kernel->refuses(kernel->self, right))) {
    for (int n = 0; n < GROUSER_OUTPUTS; n++) {
      forces[n] = NAN;
      for (int q = 0; wanted && q < 3; q++) slopes[n][q] = NAN;
    }
    return;
  }
  if (kernel->evaluate_body) {
    kernel->evaluate_body(kernel->self, left, right, wanted, forces, slopes);
    return;
  }
  if (right) {
    kernel->evaluate_track(kernel->self, left, 0, forces, wanted ? jacobian : NULL);
    kernel->evaluate_track(kernel->self, right, 1, other, wanted ? other_jacobian : NULL);
  } else {
    kernel->evaluate(kernel->self, left, forces, wanted ? jacobian : NULL);
  }
  for (int n = 0; n < GROUSER_OUTPUTS; n++) {
    if (right) forces[n] += other[n];
    for (int q = 0; wanted && q < 3; q++)
      slopes[n][q] = jacobian[n * columns + q] + (right ? other_jacobian[n * columns + q] : 0.0);
  }
}

static int all_finite(double forces[GROUSER_OUTPUTS], double slopes[GROUSER_OUTPUTS][3]) {
  for (int n = 0; n < GROUSER_OUTPUTS; n++) {
    if (!isfinite(forces[n])) return 0;
    if (slopes && !(isfinite(slopes[n][0]) && isfinite(slopes[n][1]) && isfinite(slopes[n][2]))) return 0;
  }
  return 1;
}

void grouser_blend_forces(grouser_blend *blend, const double *left, const double *right,
                          double forces[GROUSER_OUTPUTS], double slopes[GROUSER_OUTPUTS][3]) {
  const double w = blend->fallback_weight;
  const enum grouser_slopes_wanted wanted = slopes ? GROUSER_EXACT_SLOPES : GROUSER_NO_SLOPES;
  if (!blend->fallback) {
    grouser_kernel_forces(blend->primary, left, right, wanted, forces, slopes);
    return;
  }
  if (w < 1.0) {
    grouser_kernel_forces(blend->primary, left, right, wanted, forces, slopes);
    if (!all_finite(forces, slopes))
      blend->primary_failed = 1;
    else if (w <= 0.0)
      return;
    else {
      double other[GROUSER_OUTPUTS], other_slopes[GROUSER_OUTPUTS][3];
      grouser_kernel_forces(blend->fallback, left, right, wanted, other, other_slopes);
      for (int n = 0; n < GROUSER_OUTPUTS; n++) {
        forces[n] = (1 - w) * forces[n] + w * other[n];
        for (int q = 0; slopes && q < 3; q++) slopes[n][q] = (1 - w) * slopes[n][q] + w * other_slopes[n][q];
      }
      return;
    }
  }
  grouser_kernel_forces(blend->fallback, left, right, wanted, forces, slopes);
}
