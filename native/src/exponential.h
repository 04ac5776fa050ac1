/* Exponentials without branches, for loops that are to be vectorised and for vectors. */
#ifndef GROUSER_EXPONENTIAL_H
#define GROUSER_EXPONENTIAL_H

#include <stdint.h>
#include <string.h>

#include "doubles.h"
#include "lanes.h"

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

/* exp(-z) = 2^-(z log2 e). */
#define GROUSER_LOG2E 1.4426950408889634074

/* 1 - 2^-z of a vector, z >= 0, to a relative 1e-13. With -z = k + r, |r| <= 1/2, it is (1 - 2^k) - 2^k r p(r), p
 * fitted to (2^r - 1)/r for the least largest relative error, 8e-14. Terms are summed in pairs, since a cell waits for the sum
 * longer than for its terms. */
GROUSER_INLINE grouser_doubles doubles_saturation(grouser_doubles z) {
  /* 1.5 * 2^52, and the bias of the exponent: the last bits of a sum with it are those of 2^k. */
  const grouser_doubles shift = doubles_of(6755399441055744.0 + 1023.0);
  const grouser_doubles kept = doubles_least(z, doubles_of(1000.0));
  const grouser_doubles shifted = shift - kept, r = (shift - shifted) - kept;
  const grouser_doubles scale = doubles_from_bits(doubles_bits(shifted) << 52);
  const grouser_doubles square = r * r;
  const grouser_doubles first = doubles_of(0.693147180559937722) + doubles_of(0.240226506958140849) * r;
  const grouser_doubles second = doubles_of(0.055504108665734691) + doubles_of(0.00961812915905112478) * r;
  const grouser_doubles third = doubles_of(0.00133335579838191972) + doubles_of(1.54034561338382540e-4) * r;
  const grouser_doubles fourth = doubles_of(1.52528119478472625e-5) + doubles_of(1.32551605259891299e-6) * r;
  const grouser_doubles last = fourth + doubles_of(1.01780781197277182e-7) * square;
  const grouser_doubles p = (first + second * square) + (third + last * square) * (square * square);
  return (doubles_of(1.0) - scale) - (scale * r) * p;
}

GROUSER_INLINE grouser_lanes lanes_least(grouser_lanes a, grouser_lanes b) {
#if defined(__GNUC__) && defined(__AVX512F__)
  return (grouser_lanes)_mm512_maskz_min_ps(GROUSER_EVERY_FLOAT, (__m512)a, (__m512)b);
#elif defined(__GNUC__) && defined(__AVX2__) && defined(__FMA__)
  return (grouser_lanes)_mm256_min_ps((__m256)a, (__m256)b);
#else
  return lanes_where_less(a, b, a, b);
#endif
}

/* Unsigned, so that shifting into the exponent is no overflow. */
#if defined(__GNUC__) /* as lanes.h asks */
typedef uint32_t grouser_words __attribute__((vector_size(4 * GROUSER_FLOATS)));
#else
typedef uint32_t grouser_words;
#endif

/* The same of floats, to a relative 5e-7. */
GROUSER_INLINE grouser_lanes lanes_saturation(grouser_lanes z) {
  const grouser_lanes shift = lanes_of(12582912.0f + 127.0f); /* 1.5 * 2^23, and the bias */
  const grouser_lanes kept = lanes_least(z, lanes_of(126.0f));
  const grouser_lanes shifted = shift - kept, r = (shift - shifted) - kept, square = r * r;
  grouser_words bits;
  grouser_lanes scale;
  memcpy(&bits, &shifted, sizeof bits);
  bits <<= 23;
  memcpy(&scale, &bits, sizeof scale);
  const grouser_lanes first = lanes_fma(lanes_of(0.240223514f), r, lanes_of(0.693147144f));
  const grouser_lanes second = lanes_fma(lanes_of(0.00966624541f), r, lanes_of(0.0555050023f));
  const grouser_lanes third = lanes_fma(lanes_of(0.00133335335f), square, second);
  const grouser_lanes p = lanes_fma(third, square, first);
  return lanes_fma(lanes_of(0.0f) - scale * r, p, lanes_of(1.0f) - scale);
}

#endif
