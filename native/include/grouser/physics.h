/* The cell-integrated track-terrain block in float64. Equations: terrain/block.py and docs/physics.md. */
#ifndef GROUSER_PHYSICS_H
#define GROUSER_PHYSICS_H

#include "interface.h"

enum grouser_contact { GROUSER_CONTINUOUS = 0, GROUSER_PER_WHEEL = 1 };
/* How far the ground is sheared: slip velocity times contact time, or the belt point's path with full rotation. */
enum grouser_path { GROUSER_SOFT_PATH = 0, GROUSER_EXACT_PATH = 1 };
/* Of the arithmetic over the cells; loads and sums over elements are in float64 either way. */
enum grouser_precision { GROUSER_DOUBLE = 0, GROUSER_SINGLE = 1 };
enum grouser_side { GROUSER_LEFT = 0, GROUSER_RIGHT = 1 };

enum { GROUSER_MAX_WHEELS = 64, GROUSER_MAX_CELLS = 4096 };

typedef struct {
  enum grouser_mode mode;
  enum grouser_contact contact;
  enum grouser_path path;
  enum grouser_precision precision; /* single: on the soft path alone */
  int wheels;             /* contact elements a side, 1..GROUSER_MAX_WHEELS */
  int along, across;      /* cells an element, 1..GROUSER_MAX_CELLS */
  double mass;            /* kg */
  double gravity;         /* m/s^2 */
  double contact_length;  /* m */
  double element_length;  /* m */
  double element_spacing; /* m, between element centres */
  double tread;           /* m, between track centrelines */
  double track_width;     /* m */
  double cg_height;       /* m */
  double contact_center;  /* m, from the CG */
  double soft_speed;      /* m/s */
} grouser_physics;

/* Force and moment [Fx, Fy, M] (N, N, N m; M about the CG) of one track.
 *
 * x: one row of interface columns. jacobian: NULL, or 3 x columns, row-major, dF/dx.
 */
GROUSER_CORE void grouser_physics_track(const grouser_physics *block, const double *x, enum grouser_side side,
                           double force[GROUSER_OUTPUTS], double *jacobian);

/* Force on the vehicle [Qx, Qy, Mz]: both tracks. jacobian as above, or NULL. */
GROUSER_CORE void grouser_physics_forces(const grouser_physics *block, const double *x, double force[GROUSER_OUTPUTS],
                            double *jacobian);

/* As evaluate_body of a grouser_kernel. */
GROUSER_CORE void grouser_physics_body(const grouser_physics *block, const double *left, const double *right,
                                       double force[GROUSER_OUTPUTS], double slope[GROUSER_OUTPUTS][3]);

/* Name of the first column that the block cannot take (not finite, a shear modulus that is not positive, a stopped
 * belt at zero soft speed), or NULL if the row is good. */
GROUSER_CORE const char *grouser_physics_refuses(const grouser_physics *block, const double *x);

#endif
