/* A force function of interface rows, whatever stands behind it. */
#ifndef GROUSER_KERNEL_H
#define GROUSER_KERNEL_H

#include "interface.h"

/* GROUSER_BLOCK vehicles at once, column by column. */
enum { GROUSER_BLOCK = 16 };

typedef struct {
  double column[GROUSER_MAX_COLUMNS][GROUSER_BLOCK];
} grouser_block_rows;

/* [Qx, Qy, Mz] and their derivatives by vx, vy and yaw rate. */
typedef struct {
  double force[GROUSER_OUTPUTS][GROUSER_BLOCK];
  double slope[GROUSER_OUTPUTS][3][GROUSER_BLOCK];
} grouser_block_forces;

/* A force function of rows, and what it cannot take. */
typedef struct {
  const void *self;
  int columns;
  /* Writes forces (3) and, unless NULL, the jacobian (3 x columns) of one row. */
  void (*evaluate)(const void *self, const double *x, double *forces, double *jacobian);
  /* Name of the first column that is not finite or out of the function's domain, or NULL. */
  const char *(*refuses)(const void *self, const double *x);
  /* Writes the same of one track (0 left, 1 right); NULL where the tracks are not known apart. */
  void (*evaluate_track)(const void *self, const double *x, int side, double *forces, double *jacobian);
  /* Both tracks of every lane; right may be left itself. A lane whose row is not finite gives NaN there and leaves the
   * others alone. NULL: the caller goes lane by lane. */
  void (*evaluate_block)(const void *self, const grouser_block_rows *left, const grouser_block_rows *right,
                         grouser_block_forces *out);
} grouser_kernel;

#endif
