/* How the vehicle's weight spreads over its contact elements, and what shear strength the ground has under them. */
#ifndef GROUSER_LOAD_H
#define GROUSER_LOAD_H

#include "grouser/physics.h"

/* Share of an element's static load below which cohesion fades with the contact. */
#define GROUSER_COHESION_FADE 0.05

/* Normal load of one track and its derivative by ay: W/2 -+ m ay h/B, clipped to [0, W]. */
GROUSER_CORE double grouser_side_load(const grouser_physics *block, double ay, enum grouser_side side, double *by_ay);

/* Shares of the track's load by element, clipped at 0 and rescaled, and their derivatives by ax. */
GROUSER_CORE void grouser_element_shares(const grouser_physics *block, double ax, double *share, double *by_ax);

/* Shear strength under one element and its derivatives by load and by the strength parameters. */
typedef struct {
  double stress, by_load, by_parameter[2];
} grouser_strength;

/* tan(phi) of soil, 0 on firm ground: once for a track, since it is the dearest part. */
GROUSER_CORE double grouser_friction_tangent(const grouser_physics *block, const double *terrain);

GROUSER_CORE grouser_strength grouser_shear_strength(const grouser_physics *block, const double *terrain, double tangent,
                                        double load);

/* Centre of element i from the middle of the contact length. */
static inline double grouser_element_arm(const grouser_physics *block, int i) {
  return (i - (block->wheels - 1) / 2.0) * block->element_spacing;
}

#endif
