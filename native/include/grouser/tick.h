/* One tick of one vehicle: belts, body, pose, acceleration memory and guard. Equations: docs/physics.md; the readable
 * form is envs/simulator.py. */
#ifndef GROUSER_TICK_H
#define GROUSER_TICK_H

#include "ground.h"
#include "guard.h"
#include "kernel.h"

enum grouser_integrator { GROUSER_IMPLICIT = 0, GROUSER_SDIRK2 = 1, GROUSER_EULER = 2 };

enum grouser_status {
  GROUSER_SOLVED = 0,
  GROUSER_DIVERGED = 1, /* state, command or ground not finite, or no tick down to a sixteenth was solved */
  GROUSER_OFF_MAP = 2   /* the ground has no parameters at the position */
};

typedef struct {
  double mass, yaw_inertia;     /* kg, kg m^2 */
  double tread, contact_center; /* m */
  double gravity;               /* m/s^2 */
  double belt_time_constant;    /* s */
  double belt_acceleration;     /* m/s^2 */
} grouser_vehicle;

/* What no force block knows of, and what may therefore differ between the vehicles of a fleet. */
typedef struct {
  double yaw_inertia;        /* kg m^2 */
  double belt_time_constant; /* s */
  double belt_acceleration;  /* m/s^2 */
  double decay, half_decay;  /* of a belt's gap to its command, over a tick and over half of one */
} grouser_traits;

/* Position and heading in the plane, motion in body axes, belt speeds, memory of the accelerations Qx/m and Qy/m. */
typedef struct {
  double x, y, heading;         /* m, m, rad */
  double vx, vy, yaw_rate;      /* m/s, m/s, rad/s */
  double v_left, v_right;       /* m/s */
  double ax, ay;                /* m/s^2 */
  double time;                  /* s */
  grouser_guard_state guard;
} grouser_vehicle_state;

/* What stays the same from tick to tick; filled by grouser_plant_init. */
typedef struct {
  grouser_vehicle vehicle;
  const grouser_kernel *kernel; /* the primary of a guard */
  const grouser_guard *guard;   /* or NULL */
  grouser_sampling sampling;
  enum grouser_integrator integrator;
  double step;                  /* s */
  double tolerance;             /* m/s and rad/s, residual at which a stage counts as solved */
  grouser_traits traits;        /* of a vehicle that has none of its own */
} grouser_plant;

/* What one tick did. */
typedef struct {
  double row[GROUSER_MAX_COLUMNS]; /* as the block received it in the accepted evaluation */
  double force[GROUSER_OUTPUTS];   /* what it returned */
  int iterations, divisions;       /* Broyden's or Newton's steps, and parts that the tick was solved in */
  grouser_detection detection;     /* of the row at the tick's start; none, 0, without a guard */
} grouser_tick_record;

/* `tracks` asks for the ground under each track, which needs a kernel that knows the tracks apart, and no guard. */
void grouser_plant_init(grouser_plant *plant, const grouser_vehicle *vehicle, const grouser_kernel *kernel,
                        const grouser_guard *guard, int tracks, enum grouser_integrator integrator, double step,
                        double tolerance);

grouser_traits grouser_traits_of(double yaw_inertia, double belt_time_constant, double belt_acceleration, double step);

/* At rest at the origin. */
grouser_vehicle_state grouser_vehicle_at_rest(void);

/* Advances the vehicle by one tick under the commanded belt speeds (left, right; m/s); a vehicle that is not solved
 * stays as it was, and so does the record. */
enum grouser_status grouser_tick(const grouser_plant *plant, const grouser_ground *ground, const double command[2],
                                 grouser_vehicle_state *state, grouser_tick_record *record);

#endif
