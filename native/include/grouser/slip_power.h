/* Power that is lost to slip under the tracks. Meaning: envs/slip_power.py. */
#ifndef GROUSER_SLIP_POWER_H
#define GROUSER_SLIP_POWER_H

#include "kernel.h"

/* VtL FL + VtR FR - (Qx Vx + Qy Vy + Mz yaw rate) of the shear forces in W, by a kernel that knows the tracks apart, for
 * the interface rows that both tracks received in a tick and the share of the weight that pressed on the ground. */
double grouser_slip_power(const grouser_kernel *block, const double *left, const double *right, double load_ratio);

#endif
