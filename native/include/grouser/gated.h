/* A surrogate where its detector knows the row, another block elsewhere: the guard without its memory. */
#ifndef GROUSER_GATED_H
#define GROUSER_GATED_H

#include "detector.h"
#include "kernel.h"

typedef struct {
  grouser_kernel primary, fallback;
  grouser_detector detector;
} grouser_gated;

/* As evaluate of a grouser_kernel. A primary that refuses the row, or whose answer is not finite, is passed over. */
GROUSER_CORE void grouser_gated_forces(const grouser_gated *gated, const double *x, double force[GROUSER_OUTPUTS],
                                       double *jacobian);

#endif
