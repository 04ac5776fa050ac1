/* The structured surrogate: a network for one track's shear, the block's equations for the rest. Equations and names:
 * surrogate/track_model.py. */
#ifndef GROUSER_TRACK_NET_H
#define GROUSER_TRACK_NET_H

#include "dense.h"
#include "physics.h"

enum {
  GROUSER_POINTS = 4,                        /* shear points along a track */
  GROUSER_SHEAR = 2 * GROUSER_POINTS,        /* along, then across */
  GROUSER_FEATURES = GROUSER_SHEAR + 2,
  GROUSER_MAX_UNITS = 3 * GROUSER_MAX_WHEELS /* along, across, moment, element by element each */
};

typedef struct {
  grouser_physics block; /* geometry and loads; its cells are not used */
  grouser_dense dense;   /* GROUSER_FEATURES to 3 * wheels */
  double input_mean[GROUSER_FEATURES], input_scale[GROUSER_FEATURES];
  double output_mean[GROUSER_MAX_UNITS], output_scale[GROUSER_MAX_UNITS];
  double ends[2 * GROUSER_POINTS]; /* of the parts: rear ends, then front ends */
  double reach[GROUSER_POINTS], half_travel, part_length;
  /* From shear at the points to an element's mean, and to the moment of the shear across over half its length. */
  double mean[GROUSER_MAX_WHEELS][GROUSER_POINTS], moment[GROUSER_MAX_WHEELS][GROUSER_POINTS];
  /* Filled in by grouser_track_net_prepare: elements' centres from the CG, the moment about the CG of the shear across,
   * and 1/input_scale. */
  double arm[GROUSER_MAX_WHEELS], turning[GROUSER_MAX_WHEELS][GROUSER_POINTS], input_gain[GROUSER_FEATURES];
} grouser_track_net;

GROUSER_CORE void grouser_track_net_prepare(grouser_track_net *net);

/* As grouser_physics_track and grouser_physics_forces. */
GROUSER_CORE void grouser_track_net_track(const grouser_track_net *net, const double *x, enum grouser_side side,
                                          double force[GROUSER_OUTPUTS], double *jacobian);
GROUSER_CORE void grouser_track_net_forces(const grouser_track_net *net, const double *x, double force[GROUSER_OUTPUTS],
                                           double *jacobian);
/* As evaluate_body, prepare_block and evaluate_block of a grouser_kernel, the same to the bit. Leading slopes are those
 * of the quadrature over the shear points. */
GROUSER_CORE void grouser_track_net_body(const grouser_track_net *net, const double *left, const double *right,
                                         enum grouser_slopes_wanted wanted, double force[GROUSER_OUTPUTS],
                                         double slope[GROUSER_OUTPUTS][3]);
GROUSER_CORE int grouser_track_net_prepared_rows(const grouser_track_net *net);
GROUSER_CORE void grouser_track_net_prepare_block(const grouser_track_net *net, const grouser_block_rows *left,
                                                  const grouser_block_rows *right, double (*prepared)[GROUSER_BLOCK]);
GROUSER_CORE void grouser_track_net_block(const grouser_track_net *net, const grouser_block_rows *left,
                                          const grouser_block_rows *right, const double (*prepared)[GROUSER_BLOCK],
                                          enum grouser_slopes_wanted wanted, grouser_block_forces *out);

#endif
