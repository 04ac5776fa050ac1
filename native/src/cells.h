/* The cells under one contact element, and the two models of how far the ground is sheared there. */
#ifndef GROUSER_CELLS_H
#define GROUSER_CELLS_H

#include "grouser/physics.h"

/* Cells are taken in strips: long enough for the vector units, short enough for the stack. */
enum { GROUSER_LANES = 8, GROUSER_STRIP = 64 };

typedef struct {
  double offset[GROUSER_STRIP]; /* along the element, from its centre */
  double y[GROUSER_STRIP];      /* from the CG */
  double weight[GROUSER_STRIP]; /* 1, or 0 past the last cell */
  int count, lanes;             /* cells, and rounded up to whole lanes */
} grouser_cell_strip;

/* What is the same for every cell under one element. */
typedef struct {
  double vx, vy, yaw_rate, belt;
  double center;           /* of the element, from the CG */
  double reach;            /* from the cell's offset to where the shear is counted from */
  double half_travel;      /* distance travelled at the middle of that length */
  double direction;        /* s */
  double direction_slope;  /* ds/dVt */
  double soft_belt;        /* sqrt(Vt^2 + V_eps^2) */
  double modulus;          /* K */
} grouser_element_motion;

/* Sums over an element's cells at unit shear strength: the force, and its derivatives by five of the inputs. */
enum { GROUSER_BY_VX, GROUSER_BY_VY, GROUSER_BY_YAW_RATE, GROUSER_BODY_SLOPES, GROUSER_BY_BELT = GROUSER_BODY_SLOPES,
       GROUSER_BY_MODULUS, GROUSER_SLOPES };

/* Forces alone; with their slopes by the body's motion, which is what Newton asks for; with all slopes. */
enum grouser_wanted { GROUSER_FORCES_WANTED, GROUSER_BODY_SLOPES_WANTED, GROUSER_ALL_SLOPES_WANTED };

typedef struct {
  double force[GROUSER_OUTPUTS];
  double slope[GROUSER_SLOPES][GROUSER_OUTPUTS];
} grouser_element_sums;

/* Adds a strip's cells to an element's sums. Soft: the slip velocity of this moment over the contact time. */
GROUSER_CORE void grouser_soft_forces(const grouser_element_motion *motion, const grouser_cell_strip *strip,
                         grouser_element_sums *sums);
GROUSER_CORE void grouser_soft_slopes(const grouser_element_motion *motion, const grouser_cell_strip *strip,
                                      enum grouser_wanted wanted, grouser_element_sums *sums);

/* Exact: the path of the belt point over the ground, with the vehicle's rotation on the way. */
GROUSER_CORE void grouser_exact_forces(const grouser_element_motion *motion, const grouser_cell_strip *strip,
                          grouser_element_sums *sums);
GROUSER_CORE void grouser_exact_slopes(const grouser_element_motion *motion, const grouser_cell_strip *strip,
                                       enum grouser_wanted wanted, grouser_element_sums *sums);

/* The soft path in float32: cells about the centre of their element and of the track, whose centreline is at `lever`. */
enum { GROUSER_SINGLE_STRIP = 256 };

typedef struct {
  float offset[GROUSER_SINGLE_STRIP], aside[GROUSER_SINGLE_STRIP], weight[GROUSER_SINGLE_STRIP];
  int lanes;
} grouser_single_strip;

GROUSER_CORE void grouser_fill_single_strip(const grouser_physics *block, int first, grouser_single_strip *strip);
GROUSER_CORE void grouser_single_cells(const grouser_element_motion *motion, const grouser_single_strip *strip,
                                       double lever, enum grouser_wanted wanted, grouser_element_sums *sums);

#endif
