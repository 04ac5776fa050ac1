/* A force function of interface rows: what the tick asks, whatever answers. Every compiled backend's `kernel` attribute
 * is a PyCapsule named GROUSER_KERNEL_CAPSULE that holds one; it lives as long as the object that it was read from. */
#ifndef GROUSER_KERNEL_H
#define GROUSER_KERNEL_H

#include <stddef.h>

#include "interface.h"

#define GROUSER_KERNEL_CAPSULE "grouser.kernel"

/* Vehicles that are evaluated at once, and the most rows of numbers that are prepared for them. */
enum { GROUSER_BLOCK = 16, GROUSER_MAX_PREPARED = 160 };

/* Interface rows of a block, column by column. */
typedef struct {
  double column[GROUSER_MAX_COLUMNS][GROUSER_BLOCK];
} grouser_block_rows;

/* [Qx, Qy, Mz] of a block, and their derivatives by vx, vy and yaw rate. */
typedef struct {
  double force[GROUSER_OUTPUTS][GROUSER_BLOCK];
  double slope[GROUSER_OUTPUTS][3][GROUSER_BLOCK];
} grouser_block_forces;

/* Which slopes are asked for. Leading ones may leave out what is small but dear, such as what a network adds to the
 * equations that it stands in: enough to begin an iteration that corrects its matrix on the way. */
enum grouser_slopes_wanted { GROUSER_NO_SLOPES, GROUSER_LEADING_SLOPES, GROUSER_EXACT_SLOPES };

typedef struct {
  const void *self;
  int columns;
  /* Writes forces (3) and, unless NULL, the jacobian (3 x columns) of one row. */
  void (*evaluate)(const void *self, const double *x, double *forces, double *jacobian);
  /* Name of the first column that is not finite or out of the function's domain, or NULL. */
  const char *(*refuses)(const void *self, const double *x);
  /* Writes the same of one track (0 left, 1 right); NULL where the tracks are not known apart. */
  void (*evaluate_track)(const void *self, const double *x, int side, double *forces, double *jacobian);
  /* Evaluates a block, each track from its own rows (right may be left itself). A lane whose row is not finite gives
   * NaN there and leaves the others alone. `prepared` is what prepare_block wrote for these lanes, if there is such.
   * NULL where rows are taken one by one. */
  void (*evaluate_block)(const void *self, const grouser_block_rows *left, const grouser_block_rows *right,
                         const double (*prepared)[GROUSER_BLOCK], enum grouser_slopes_wanted wanted,
                         grouser_block_forces *out);
  /* Writes the forces (rows x 3) of many rows; NULL where that is no faster than one by one. */
  void (*evaluate_rows)(const void *self, const double *x, ptrdiff_t rows, double *forces);
  /* Writes the forces of one vehicle, the right track from its own row or, if NULL, from the left one, and their slopes
   * by vx, vy and yaw rate, as far as they are wanted; NULL where evaluate is as good. */
  void (*evaluate_body)(const void *self, const double *left, const double *right, enum grouser_slopes_wanted wanted,
                        double *forces, double slopes[GROUSER_OUTPUTS][3]);
  /* Writes what belts, accelerations and terrain alone decide, lane by lane in `prepared_rows` rows: once for as many
   * evaluations as the body takes within a tick. NULL where nothing is worth it. */
  void (*prepare_block)(const void *self, const grouser_block_rows *left, const grouser_block_rows *right,
                        double (*prepared)[GROUSER_BLOCK]);
  int prepared_rows;
} grouser_kernel;

#endif
