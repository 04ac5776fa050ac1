/* $title
 *
 * SPDX-License-Identifier: MIT
 * Written by grouser $version from the artifact $hash.
 * Any number of threads may call any function; the only memory is what the caller passes in. */
#ifndef GROUSER_H
#define GROUSER_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Changes with the declarations below. */
#define GROUSER_ABI_VERSION $abi

enum { GROUSER_COLUMNS = $columns, GROUSER_PARAMETERS = $parameters };

$types
/* An interface row:
$table
 */
enum grouser_parameter { $enumerators };

/* Who gives the force: the surrogate where it was trained and the fallback elsewhere, or one of them alone. */
enum grouser_source { GROUSER_GUARDED = 0, GROUSER_SURROGATE_ALONE = 1, GROUSER_FALLBACK_ALONE = 2 };

/* Returned beside the values of grouser_status: a row that grouser_refused_column names, a belt command that is not
 * within +-GROUSER_MAXIMUM_SPEED (m/s), a tick that is not in (0, 1] s. Nothing is written. */
enum { GROUSER_REFUSED = 16 };
#define GROUSER_MAXIMUM_SPEED $maximum_speed

/* SHA-256 of the artifact in hexadecimal, and the columns' names. */
extern const char grouser_artifact_hash[65];
extern const char *const grouser_column_names[GROUSER_COLUMNS];

/* GROUSER_ABI_VERSION of the compiled file, and whether it is the caller's: 1 or 0. */
int grouser_abi_version(void);
int grouser_abi_matches(int version);

/* 0, or the number of the first check that failed: 1 tables, 2 forces and 3 Jacobian of the surrogate, 4 forces and 5
 * Jacobian of the fallback, 6 detector, 7 guard, 8 tick. */
int grouser_self_test(void);

/* First column of a row that cannot be taken (not finite, or out of the fallback's domain), or -1. */
int grouser_refused_column(const double x[GROUSER_COLUMNS]);

/* [Qx, Qy, Mz] in N, N, N m and, unless NULL, their derivatives by every column, 3 x GROUSER_COLUMNS, row-major.
 * Return 0 or GROUSER_REFUSED. */
int grouser_surrogate_forces(const double x[GROUSER_COLUMNS], double force[GROUSER_OUTPUTS], double *jacobian);
int grouser_fallback_forces(const double x[GROUSER_COLUMNS], double force[GROUSER_OUTPUTS], double *jacobian);

/* Whether a row looks like the training data; it need not be finite. A score above 1 does not. */
grouser_detection grouser_score(const double x[GROUSER_COLUMNS]);

/* The guard's memory of a vehicle that nobody has looked at yet. */
grouser_guard_state grouser_fresh_guard(void);

/* Advances the guard by `elapsed` s with this row, and writes the forces of whom it chose and, unless NULL, their
 * derivatives by vx, vy and yaw rate (3 x 3, row-major), and what the detector said. Returns 0, or GROUSER_REFUSED also
 * where `elapsed` is not a time. */
int grouser_guarded_forces(grouser_guard_state *guard, double elapsed, const double x[GROUSER_COLUMNS],
                           double force[GROUSER_OUTPUTS], double *body_jacobian, grouser_detection *detection);

/* A vehicle at rest at the origin. */
grouser_vehicle_state grouser_at_rest(void);

/* One tick of `seconds`: belts, implicit step of the body, pose, memory of the accelerations, guard. The ground has
 * these parameters under both tracks and, unless `slope` is NULL, the slope (dz/dx, dz/dy) at the vehicle. `record` may
 * be NULL. Returns a grouser_status, or GROUSER_REFUSED; but for GROUSER_SOLVED everything stays as it was. */
int grouser_vehicle_tick(enum grouser_source source, double seconds, const double command[2],
                         const double terrain[GROUSER_PARAMETERS], const double *slope, grouser_vehicle_state *state,
                         grouser_tick_record *record);

#ifdef __cplusplus
}
#endif

#endif
