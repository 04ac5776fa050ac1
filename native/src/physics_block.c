#include "physics_block.h"

#include <math.h>
#include <string.h>

#include "exponential.h"
#include "lane_loop.h"
#include "load.h"
#include "load_block.h"

/* What the belt of each lane makes of its slip. */
typedef struct {
  double along[GROUSER_BLOCK], direction[GROUSER_BLOCK], gain[GROUSER_BLOCK];
} block_belt;

int grouser_physics_has_block(const grouser_physics *block) {
  return block->path == GROUSER_SOFT_PATH && block->precision == GROUSER_DOUBLE;
}

/* Adds a cell's force at unit strength: as grouser_soft_forces. */
static void add_cell(const grouser_block_rows *rows, const block_belt *belt, double half_travel, double center,
                     double offset, double reach, double y, double sum[GROUSER_OUTPUTS][GROUSER_BLOCK]) {
  const double x = center + offset;
  GROUSER_LANE_LOOP
  for (int l = 0; l < GROUSER_BLOCK; l++) {
    const double yaw_rate = rows->column[GROUSER_YAW_RATE][l];
    const double stretch = (half_travel - belt->direction[l] * (offset + reach)) * belt->gain[l];
    const double ux = stretch * (belt->along[l] - yaw_rate * y);
    const double uy = stretch * (rows->column[GROUSER_VY][l] + yaw_rate * x);
    const double z = sqrt(ux * ux + uy * uy), rise = expm1_negative(z);
    const double factor = z > 0 ? rise / (z > 0 ? z : 1.0) : -1.0;
    const double fx = factor * ux, fy = factor * uy;
    sum[0][l] += fx;
    sum[1][l] += fy;
    sum[2][l] += x * fy - y * fx;
  }
}

void grouser_physics_track_block(const grouser_physics *block, const grouser_block_rows *rows, enum grouser_side side,
                                 double force[GROUSER_OUTPUTS][GROUSER_BLOCK]) {
  const int columns = grouser_columns(block->mode), continuous = block->contact == GROUSER_CONTINUOUS;
  const double *speed = grouser_belt_in(rows, side), *rolling = rows->column[columns - 2];
  const double lever = grouser_sign(side) * (block->tread / 2), soft_square = block->soft_speed * block->soft_speed;
  const double half_travel = (continuous ? block->contact_length : block->element_length) / 2;
  double share[GROUSER_MAX_WHEELS][GROUSER_BLOCK], stress[GROUSER_MAX_WHEELS][GROUSER_BLOCK], load[GROUSER_BLOCK];
  block_belt belt;
  grouser_block_shares(block, rows, share);
  grouser_load_block(block, rows, side, (const double(*)[GROUSER_BLOCK])share, load, stress);
  GROUSER_LANE_LOOP
  for (int l = 0; l < GROUSER_BLOCK; l++) {
    const double soft_belt = sqrt(speed[l] * speed[l] + soft_square);
    belt.along[l] = rows->column[GROUSER_VX][l] - speed[l];
    belt.direction[l] = speed[l] / soft_belt;
    belt.gain[l] = 1.0 / (soft_belt * rows->column[columns - 1][l]);
    force[0][l] = -rolling[l] * load[l] * belt.direction[l];
    force[1][l] = 0.0;
    force[2][l] = -lever * force[0][l];
  }
  for (int i = 0; i < block->wheels; i++) {
    const double arm = grouser_element_arm(block, i), cells = block->along * block->across;
    double sum[GROUSER_OUTPUTS][GROUSER_BLOCK];
    memset(sum, 0, sizeof sum);
    for (int a = 0; a < block->along; a++)
      for (int c = 0; c < block->across; c++)
        add_cell(rows, &belt, half_travel, block->contact_center + arm,
                 ((a + 0.5) / block->along - 0.5) * block->element_length, continuous ? arm : 0.0,
                 lever + grouser_sign(side) * (((c + 0.5) / block->across - 0.5) * block->track_width), sum);
    for (int n = 0; n < GROUSER_OUTPUTS; n++)
      GROUSER_LANE_LOOP
      for (int l = 0; l < GROUSER_BLOCK; l++) force[n][l] += stress[i][l] / cells * sum[n][l];
  }
}
