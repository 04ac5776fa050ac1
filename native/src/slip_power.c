#include "grouser/slip_power.h"

#include <stddef.h>
#include <string.h>

/* The row on level ground whose shear forces, times the load ratio, are those of `row`: the rule of terrain/slope.py. */
static void shear_row(int columns, const double *row, double load_ratio, double *level) {
  memcpy(level, row, sizeof(double) * (size_t)columns);
  if (load_ratio != 1.0) {
    level[GROUSER_AX] /= load_ratio;
    level[GROUSER_AY] /= load_ratio;
    if (columns == grouser_columns(GROUSER_SOIL)) level[GROUSER_TERRAIN] /= load_ratio;
  }
  /* Rolling resistance, the last parameter but one, acts on the body and is no slip. */
  level[columns - 2] = 0.0;
}

double grouser_slip_power(const grouser_kernel *block, const double *left, const double *right, double load_ratio) {
  const double *rows[] = {left, right};
  double tracks[2][GROUSER_OUTPUTS];
  for (int side = 0; side < 2; side++) {
    double level[GROUSER_MAX_COLUMNS];
    shear_row(block->columns, rows[side], load_ratio, level);
    block->evaluate_track(block->self, level, side, tracks[side], NULL);
    for (int output = 0; output < GROUSER_OUTPUTS; output++) tracks[side][output] *= load_ratio;
  }
  const double belts = left[GROUSER_V_LEFT] * tracks[0][0] + left[GROUSER_V_RIGHT] * tracks[1][0];
  double body = 0.0;
  for (int output = 0; output < GROUSER_OUTPUTS; output++)
    body += left[GROUSER_VX + output] * (tracks[0][output] + tracks[1][output]);
  return belts - body;
}
