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

/* The same in float32, to about one unit in the last place; the Taylor sum ends at r^7/7!. */
static inline float expm1_negative_single(float z) {
  static const float LOG2E = 1.44269504f, LN2_HIGH = 0.693359375f, LN2_LOW = -2.12194440e-4f,
                     SHIFT = 12582912.0f; /* 1.5 * 2^23 */
  const float minus = z < 87.0f ? -z : -87.0f;
  const float shifted = minus * LOG2E + SHIFT;
  const float k = shifted - SHIFT;
  const float r = (minus - k * LN2_HIGH) - k * LN2_LOW;
  float p = 1.0f / 5040.0f;
  p = p * r + 1.0f / 720.0f;
  p = p * r + 1.0f / 120.0f;
  p = p * r + 1.0f / 24.0f;
  p = p * r + 1.0f / 6.0f;
  p = p * r + 0.5f;
  const float series = r + r * r * p;
  uint32_t bits;
  float scale;
  memcpy(&bits, &shifted, sizeof bits);
  bits = (bits + 127u) << 23;
  memcpy(&scale, &bits, sizeof scale);
  return scale * series + (scale - 1.0f);
}

#endif
