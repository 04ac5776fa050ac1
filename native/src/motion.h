/* Belts that follow their commands, and the direction of a heading: for one vehicle, and for loops over many. */
#ifndef GROUSER_MOTION_H
#define GROUSER_MOTION_H

#include <math.h>
#include <stdint.h>
#include <string.h>

#include "grouser/tick.h"

/* dV/dt = clip((u - V)/T_d, +-a): while the gap exceeds a T_d the belt ramps, for so long. */
static inline double grouser_ramp_time(double gap, double time_constant, double acceleration) {
  return (fabs(gap) - acceleration * time_constant) / acceleration;
}

static inline double grouser_belt_on_ramp(double speed, double gap, double acceleration, double elapsed) {
  return speed + copysign(acceleration, gap) * elapsed;
}

/* Then it closes in exponentially. `decay` is that of a gap over all of the elapsed time. */
static inline double grouser_belt_after(const grouser_traits *traits, double speed, double command, double elapsed,
                                        double decay) {
  const double gap = command - speed, acceleration = traits->belt_acceleration;
  const double ramp_time = grouser_ramp_time(gap, traits->belt_time_constant, acceleration);
  if (ramp_time >= elapsed) return grouser_belt_on_ramp(speed, gap, acceleration, elapsed);
  if (ramp_time > 0)
    return command - copysign(acceleration * traits->belt_time_constant, gap) *
                         exp(-(elapsed - ramp_time) / traits->belt_time_constant);
  return command - gap * decay;
}

typedef struct {
  double cosine, sine;
} grouser_turn;

/* Headings in rad up to which the turn below is good to rounding. */
#define GROUSER_WIDEST_TURN 1e6

/* Cosine and sine without branches: heading = k pi/2 + r, |r| <= pi/4, k pi/2 in three parts whose products with k are
 * exact. The Taylor sums end at r^15/15! and r^16/16!, below rounding. */
static inline grouser_turn grouser_narrow_turn(double heading) {
  static const double PER_QUARTER = 6.36619772367581382433e-01, SHIFT = 6755399441055744.0, /* 1.5 * 2^52 */
      QUARTER_HIGH = 1.57079632673412561417e+00, QUARTER_MIDDLE = 6.07710050630396597660e-11,
      QUARTER_LOW = 2.02226624879595063154e-21;
  const double shifted = heading * PER_QUARTER + SHIFT, k = shifted - SHIFT;
  const double r = ((heading - k * QUARTER_HIGH) - k * QUARTER_MIDDLE) - k * QUARTER_LOW, q = r * r;
  double s = -1.0 / 1307674368000.0, c = 1.0 / 20922789888000.0;
  s = s * q + 1.0 / 6227020800.0;
  c = c * q - 1.0 / 87178291200.0;
  s = s * q - 1.0 / 39916800.0;
  c = c * q + 1.0 / 479001600.0;
  s = s * q + 1.0 / 362880.0;
  c = c * q - 1.0 / 3628800.0;
  s = s * q - 1.0 / 5040.0;
  c = c * q + 1.0 / 40320.0;
  s = s * q + 1.0 / 120.0;
  c = c * q - 1.0 / 720.0;
  s = s * q - 1.0 / 6.0;
  c = c * q + 1.0 / 24.0;
  s = r + r * q * s;
  c = 1.0 - q * (0.5 - q * c);
  uint64_t quarter;
  memcpy(&quarter, &shifted, sizeof quarter);
  const double cosine = quarter & 1 ? s : c, sine = quarter & 1 ? c : s;
  const grouser_turn turn = {(quarter + 1) & 2 ? -cosine : cosine, quarter & 2 ? -sine : sine};
  return turn;
}

static inline grouser_turn grouser_turn_of(double heading) {
  if (fabs(heading) <= GROUSER_WIDEST_TURN) return grouser_narrow_turn(heading);
  const grouser_turn wide = {cos(heading), sin(heading)};
  return wide;
}

#endif
