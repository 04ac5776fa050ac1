#include "grouser/gated.h"

#include <math.h>
#include <stddef.h>

void grouser_gated_forces(const grouser_gated *gated, const double *x, double force[GROUSER_OUTPUTS],
                          double *jacobian) {
  const grouser_kernel *primary = &gated->primary, *fallback = &gated->fallback;
  if (grouser_in_distribution(&gated->detector, x) && !primary->refuses(primary->self, x)) {
    primary->evaluate(primary->self, x, force, jacobian);
    double sum = force[0] + force[1] + force[2];
    for (int n = 0; jacobian && n < GROUSER_OUTPUTS * primary->columns; n++) sum += jacobian[n];
    if (isfinite(sum)) return;
  }
  fallback->evaluate(fallback->self, x, force, jacobian);
}
