/* Power that is lost to slip under the tracks. Meaning: envs/slip_power.py. */
#ifndef GROUSER_SLIP_POWER_H
#define GROUSER_SLIP_POWER_H

#include "kernel.h"

/* VtL F_L + VtR F_R - (Qx Vx + Qy Vy + Mz w) of the shear forces of a block of vehicles, in W, by a kernel that knows
 * the tracks apart. Rows are as the vehicles' own kernel received them, on ground that bears `load_ratio` of the
 * weight; they are overwritten. A lane whose row is not finite gives what it may, and leaves the others alone. */
void grouser_slip_power(const grouser_kernel *block, grouser_block_rows *left, grouser_block_rows *right,
                        const double *load_ratio, double *power);

#endif
