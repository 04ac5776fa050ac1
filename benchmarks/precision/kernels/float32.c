#include "network.h"

typedef float weight;

INLINE __m512 widened(const weight *from) {
  return _mm512_load_ps(from);
}

#include "panels.h"

static void affine(int index, const float *in, float *out, int rectified) {
  widening_affine(index, in, out, rectified);
}
