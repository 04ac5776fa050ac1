/* Exponentials without branches, for loops that are to be vectorised and for vectors. */
#ifndef GROUSER_EXPONENTIAL_H
#define GROUSER_EXPONENTIAL_H

#include <stdint.h>
#include <string.h>

#include "doubles.h"
#include "lanes.h"

/* exp(-z) = 2^-(z log2 e). */
#define GROUSER_LOG2E 1.4426950408889634074

/* (2^r - 1)/r over |r| <= 1/2 by powers of r, fitted for the least largest relative error, 8e-14. */
static const double GROUSER_RISE[9] = {
    0.693147180559937722, 0.240226506958140849, 0.055504108665734691,
    0.00961812915905112478, 0.00133335579838191972, 1.54034561338382540e-4,
    1.52528119478472625e-5, 1.32551605259891299e-6, 1.01780781197277182e-7};
/* 1.5 * 2^52, and the bias of the exponent: the last bits of a sum with it are those of 2^k. */
static const double GROUSER_EXPONENT_SHIFT = 6755399441055744.0 + 1023.0;

/* 1 - 2^-z of a vector, z >= 0, to a relative 1e-13. With -z = k + r, |r| <= 1/2, it is (1 - 2^k) - 2^k r p(r). Terms are
 * summed in pairs, since a cell waits for the sum longer than for its terms. */
GROUSER_INLINE grouser_doubles doubles_saturation(grouser_doubles z) {
  const grouser_doubles shift = doubles_of(GROUSER_EXPONENT_SHIFT);
  const grouser_doubles kept = doubles_least(z, doubles_of(1000.0));
  const grouser_doubles shifted = shift - kept, r = (shift - shifted) - kept;
  const grouser_doubles scale = doubles_from_bits(doubles_bits(shifted) << 52);
  const grouser_doubles square = r * r;
  const grouser_doubles first = doubles_of(GROUSER_RISE[0]) + doubles_of(GROUSER_RISE[1]) * r;
  const grouser_doubles second = doubles_of(GROUSER_RISE[2]) + doubles_of(GROUSER_RISE[3]) * r;
  const grouser_doubles third = doubles_of(GROUSER_RISE[4]) + doubles_of(GROUSER_RISE[5]) * r;
  const grouser_doubles fourth = doubles_of(GROUSER_RISE[6]) + doubles_of(GROUSER_RISE[7]) * r;
  const grouser_doubles last = fourth + doubles_of(GROUSER_RISE[8]) * square;
  const grouser_doubles p = (first + second * square) + (third + last * square) * (square * square);
  return (doubles_of(1.0) - scale) - (scale * r) * p;
}

/* exp(-z) - 1 of a lone double, by the same sum, for loops that are to be vectorised. */
static inline double expm1_negative(double z) {
  const double halvings = z * GROUSER_LOG2E, kept = halvings < 1000.0 ? halvings : 1000.0;
  const double shifted = GROUSER_EXPONENT_SHIFT - kept, r = (GROUSER_EXPONENT_SHIFT - shifted) - kept, square = r * r;
  const double first = GROUSER_RISE[0] + GROUSER_RISE[1] * r;
  const double second = GROUSER_RISE[2] + GROUSER_RISE[3] * r;
  const double third = GROUSER_RISE[4] + GROUSER_RISE[5] * r;
  const double fourth = GROUSER_RISE[6] + GROUSER_RISE[7] * r;
  const double last = fourth + GROUSER_RISE[8] * square;
  const double p = (first + second * square) + (third + last * square) * (square * square);
  uint64_t bits;
  double scale;
  memcpy(&bits, &shifted, sizeof bits);
  bits <<= 52;
  memcpy(&scale, &bits, sizeof scale);
  return (scale * r) * p - (1.0 - scale);
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
