#include "grouser/slip_power.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

/* Rows on level ground whose shear forces, times the load ratio, are those of `rows`: the rule of terrain/slope.py.
 * Rolling resistance, the last parameter but one, acts on the body and is no slip. */
static void shear_rows(int columns, const double *load_ratio, grouser_block_rows *rows) {
  for (int l = 0; l < GROUSER_BLOCK; l++) {
    rows->column[GROUSER_AX][l] /= load_ratio[l];
    rows->column[GROUSER_AY][l] /= load_ratio[l];
    if (columns == grouser_columns(GROUSER_SOIL)) rows->column[GROUSER_TERRAIN][l] /= load_ratio[l];
    rows->column[columns - 2][l] = 0.0;
  }
}

static void track_forces(const grouser_kernel *block, const grouser_block_rows *rows, int side,
                         double force[GROUSER_OUTPUTS][GROUSER_BLOCK]) {
  if (block->evaluate_track_block) {
    block->evaluate_track_block(block->self, rows, side, force);
    return;
  }
  for (int l = 0; l < GROUSER_BLOCK; l++) {
    double row[GROUSER_MAX_COLUMNS], own[GROUSER_OUTPUTS];
    for (int n = 0; n < block->columns; n++) row[n] = rows->column[n][l];
    block->evaluate_track(block->self, row, side, own, NULL);
    for (int n = 0; n < GROUSER_OUTPUTS; n++) force[n][l] = own[n];
  }
}

void grouser_slip_power(const grouser_kernel *block, grouser_block_rows *left, grouser_block_rows *right,
                        const double *load_ratio, double *power) {
  grouser_block_rows *rows[] = {left, right};
  double tracks[2][GROUSER_OUTPUTS][GROUSER_BLOCK];
  for (int side = 0; side < 2; side++) {
    shear_rows(block->columns, load_ratio, rows[side]);
    track_forces(block, rows[side], side, tracks[side]);
  }
  for (int l = 0; l < GROUSER_BLOCK; l++) {
    const double belts =
        left->column[GROUSER_V_LEFT][l] * tracks[0][0][l] + left->column[GROUSER_V_RIGHT][l] * tracks[1][0][l];
    double body = 0.0;
    for (int output = 0; output < GROUSER_OUTPUTS; output++)
      body += left->column[GROUSER_VX + output][l] * (tracks[0][output][l] + tracks[1][output][l]);
    power[l] = load_ratio[l] * (belts - body);
  }
}
