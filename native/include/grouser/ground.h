/* The ground under a vehicle: terrain parameters and slope at a position. Meaning and names: terrain/field.py,
 * terrain/slope.py and envs/footing.py. */
#ifndef GROUSER_GROUND_H
#define GROUSER_GROUND_H

#include "interface.h"

enum { GROUSER_MAX_PARAMETERS = GROUSER_MAX_COLUMNS - GROUSER_TERRAIN };

enum grouser_outside { GROUSER_REFUSE = 0, GROUSER_EXTEND = 1 };

/* Terrain parameters, and heights if there are any, by cell; between the centres a quadratic B-spline. */
typedef struct {
  int rows, columns; /* along y, along x */
  int parameters;
  double x, y;       /* m, the map's corner with the lowest coordinates */
  double spacing;    /* m, edge of a cell */
  enum grouser_outside outside;
  const double *theta;  /* (rows + 2) x (columns + 2) x parameters: the outermost cells once again around the map */
  const double *height; /* m, (rows + 2) x (columns + 2); or NULL */
} grouser_field;

typedef struct {
  const grouser_field *field; /* NULL: theta everywhere */
  int parameters;
  double theta[2][GROUSER_MAX_PARAMETERS]; /* under the left and the right track; under the vehicle, the left one */
  double slope_x, slope_y;                 /* dz/dx and dz/dy, added to the field's own */
} grouser_ground;

/* Ground and gravity of one tick. */
typedef struct {
  double theta[2][GROUSER_MAX_PARAMETERS];
  int split;                 /* whether each track has its own theta; else theta[1] is not used */
  double pull_x, pull_y;     /* m/s^2, gravity along the body axes */
  double load_ratio;         /* share of the weight that presses on the ground */
} grouser_footing;

/* Where the ground is asked. */
typedef struct {
  double gravity;        /* m/s^2 */
  double contact_center; /* m, of the contact length, from the CG */
  double tread;          /* m */
  int tracks;            /* whether theta is taken at the middle of each track, or at the CG */
} grouser_sampling;

/* Ground of a vehicle whose CG is at (x, y) and whose heading has this sine and cosine; 0 where that is not finite, or
 * off the map of a field that refuses it. */
int grouser_sample_ground(const grouser_ground *ground, const grouser_sampling *sampling, double x, double y,
                          double cosine, double sine, grouser_footing *footing);

/* Parameters at (x, y), and the slope there unless `slope` is NULL; 0 as above. */
int grouser_field_at(const grouser_field *field, double x, double y, double *theta, double slope[2]);

#endif
