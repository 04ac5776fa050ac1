/* The interface of the track-terrain block: columns and their order, as grouser.terrain.interface has them. */
#ifndef GROUSER_INTERFACE_H
#define GROUSER_INTERFACE_H

/* How the core's functions are linked: as they are, or static where its files are included into one. */
#ifndef GROUSER_CORE
#define GROUSER_CORE
#endif

enum grouser_mode { GROUSER_RIGID = 0, GROUSER_SOIL = 1 };

enum { GROUSER_OUTPUTS = 3, GROUSER_MAX_COLUMNS = 11 };

/* Columns common to both modes. */
enum grouser_motion {
  GROUSER_VX,
  GROUSER_VY,
  GROUSER_YAW_RATE,
  GROUSER_AX,
  GROUSER_AY,
  GROUSER_V_LEFT,
  GROUSER_V_RIGHT,
  GROUSER_TERRAIN /* first terrain parameter */
};

/* Column names by mode, NULL-terminated. */
#define GROUSER_RIGID_COLUMNS \
  "vx", "vy", "yaw_rate", "ax", "ay", "v_left", "v_right", "mu", "fr", "k", (const char *)0
#define GROUSER_SOIL_COLUMNS \
  "vx", "vy", "yaw_rate", "ax", "ay", "v_left", "v_right", "c", "phi", "fr", "k", (const char *)0

static inline int grouser_columns(enum grouser_mode mode) { return mode == GROUSER_RIGID ? 10 : 11; }

#endif
