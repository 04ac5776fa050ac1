/* An exponential without branches, for loops that are to be vectorised. */
#ifndef GROUSER_EXPONENTIAL_H
#define GROUSER_EXPONENTIAL_H

#include <stdint.h>
#include <string.h>

/* exp(-z) - 1 for z >= 0, without branches: -z = k ln 2 + r, |r| <= ln 2 / 2, then 2^k expm1(r) + (2^k - 1).
 * The Taylor sum ends at r^13/13!, below 1e-17; at k = 0 the relative error stays at rounding. */
static inline double expm1_negative(double z) {
  static const double LOG2E = 1.4426950408889634074, LN2_HIGH = 6.93147180369123816490e-01,
                      LN2_LOW = 1.90821492927058770002e-10, SHIFT = 6755399441055744.0; /* 1.5 * 2^52 */
  const double minus = z < 700.0 ? -z : -700.0;
  const double shifted = minus * LOG2E + SHIFT;
  const double k = shifted - SHIFT;
  const double r = (minus - k * LN2_HIGH) - k * LN2_LOW;
  double p = 1.0 / 6227020800.0;
  p = p * r + 1.0 / 479001600.0;
  p = p * r + 1.0 / 39916800.0;
  p = p * r + 1.0 / 3628800.0;
  p = p * r + 1.0 / 362880.0;
  p = p * r + 1.0 / 40320.0;
  p = p * r + 1.0 / 5040.0;
  p = p * r + 1.0 / 720.0;
  p = p * r + 1.0 / 120.0;
  p = p * r + 1.0 / 24.0;
  p = p * r + 1.0 / 6.0;
  p = p * r + 0.5;
  const double series = r + r * r * p;
  uint64_t bits;
  double scale;
  memcpy(&bits, &shifted, sizeof bits);
  bits = (bits + 1023) << 52;
  memcpy(&scale, &bits, sizeof scale);
  return scale * series + (scale - 1.0);
}

#endif
