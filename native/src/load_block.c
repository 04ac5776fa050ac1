#include "load_block.h"

#include <math.h>

#include "lane_loop.h"
#include "load.h"

void grouser_block_shares(const grouser_physics *block, const grouser_block_rows *rows,
                          double (*share)[GROUSER_BLOCK]) {
  const int count = block->wheels;
  const double lean_slope = -block->cg_height / block->gravity;
  double spread = 0, total[GROUSER_BLOCK];
  for (int i = 0; i < count; i++) spread += grouser_element_arm(block, i) * grouser_element_arm(block, i);
  const double per_spread = spread > 0 ? 1.0 / spread : 0.0;
  GROUSER_LANE_LOOP
  for (int l = 0; l < GROUSER_BLOCK; l++) total[l] = 0;
  for (int i = 0; i < count; i++) {
    const double gain = grouser_element_arm(block, i) * per_spread;
    GROUSER_LANE_LOOP
    for (int l = 0; l < GROUSER_BLOCK; l++) {
      const double lean = lean_slope * rows->column[GROUSER_AX][l] - block->contact_center;
      const double raw = 1.0 / count + gain * lean;
      /* A raw share that is not a number passes. */
      share[i][l] = raw < 0 ? 0.0 : raw;
      total[l] += share[i][l];
    }
  }
  GROUSER_LANE_LOOP
  for (int l = 0; l < GROUSER_BLOCK; l++) total[l] = 1.0 / total[l];
  for (int i = 0; i < count; i++)
    GROUSER_LANE_LOOP
    for (int l = 0; l < GROUSER_BLOCK; l++) share[i][l] *= total[l];
}

void grouser_load_block(const grouser_physics *block, const grouser_block_rows *rows, enum grouser_side side,
                        const double (*share)[GROUSER_BLOCK], double *track_load, double (*stress)[GROUSER_BLOCK]) {
  const int count = block->wheels;
  const double area = block->element_length * block->track_width, per_area = 1.0 / area;
  const double weight = block->mass * block->gravity;
  const double transfer = -grouser_sign(side) * (block->mass * block->cg_height / block->tread);
  const double *strength = rows->column[GROUSER_TERRAIN], *angle = rows->column[GROUSER_TERRAIN + 1];
  GROUSER_LANE_LOOP
  for (int l = 0; l < GROUSER_BLOCK; l++) {
    const double load = weight / 2 + transfer * rows->column[GROUSER_AY][l];
    track_load[l] = load < 0 ? 0.0 : load > weight ? weight : load;
  }
  if (block->mode == GROUSER_RIGID) {
    for (int i = 0; i < count; i++)
      GROUSER_LANE_LOOP
      for (int l = 0; l < GROUSER_BLOCK; l++) stress[i][l] = strength[l] * (track_load[l] * share[i][l] * per_area) * area;
    return;
  }
  double tangent[GROUSER_BLOCK];
  const double full_contact = GROUSER_COHESION_FADE * block->mass * block->gravity / (2 * count);
  /* Vehicles mostly share their ground, and the tangent is the dearest part. */
  GROUSER_LANE_LOOP
  for (int l = 0; l < GROUSER_BLOCK; l++)
    tangent[l] = l > 0 && angle[l] == angle[l - 1] ? tangent[l - 1] : tan(angle[l]);
  for (int i = 0; i < count; i++)
    GROUSER_LANE_LOOP
    for (int l = 0; l < GROUSER_BLOCK; l++) {
      const double load = track_load[l] * share[i][l], pressure = load * per_area;
      const double fade = load < full_contact ? load / full_contact : 1.0;
      stress[i][l] = (strength[l] * fade + pressure * tangent[l]) * area;
    }
}
