/* The structured surrogate: a network for one track's shear, the block's equations for the rest. Equations and names:
 * surrogate/track_model.py. */
#ifndef GROUSER_TRACK_NET_H
#define GROUSER_TRACK_NET_H

#include "dense.h"
#include "physics.h"

enum {
  GROUSER_POINTS = 4,                         /* shear points along a track */
  GROUSER_SHEAR = 2 * GROUSER_POINTS,         /* along, then across */
  GROUSER_FEATURES = GROUSER_SHEAR + 2,
  GROUSER_MAX_UNITS = 3 * GROUSER_MAX_WHEELS  /* along, across, moment, element by element each */
};

typedef struct {
  grouser_physics block; /* geometry and loads; its cells are not used */
  grouser_dense dense;   /* GROUSER_FEATURES to 3 * wheels */
  double input_mean[GROUSER_FEATURES], input_scale[GROUSER_FEATURES];
  double output_mean[GROUSER_MAX_UNITS], output_scale[GROUSER_MAX_UNITS];
  double ends[2 * GROUSER_POINTS]; /* of the parts: rear ends, then front ends */
  double reach[GROUSER_POINTS], half_travel, part_length;
  double weights[GROUSER_SHEAR * GROUSER_MAX_UNITS]; /* shear x units, row-major with 3 * wheels a row */
} grouser_track_net;

/* As grouser_physics_track and grouser_physics_forces. */
void grouser_track_net_track(const grouser_track_net *net, const double *x, enum grouser_side side,
                             double force[GROUSER_OUTPUTS], double *jacobian);
void grouser_track_net_forces(const grouser_track_net *net, const double *x, double force[GROUSER_OUTPUTS],
                              double *jacobian);

#endif
