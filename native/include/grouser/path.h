/* A path to follow, as grouser.envs.Path has it: samples at equal steps of arc length. */
#ifndef GROUSER_PATH_H
#define GROUSER_PATH_H

typedef struct {
  double x, y;             /* m */
  double heading;          /* rad, unwrapped */
  double curvature;        /* 1/m, positive in a left turn */
  double cosine, sine;     /* of the heading */
} grouser_path_node;

typedef struct {
  const grouser_path_node *nodes;
  long count;              /* of the nodes, at least 2 */
  int closed;              /* the last node is the first, one turn later */
  double length, step;     /* m; step = length / (count - 1) */
  double turn;             /* rad, heading of the last node less that of the first */
} grouser_path;

/* A point on the path. */
typedef struct {
  double x, y, heading, curvature;
} grouser_path_point;

/* The foot of a position. */
typedef struct {
  double arc_length;       /* m; beyond [0, length] past the ends of an open path, and over the laps of a closed one */
  double cross_track;      /* m, positive where the position lies to the left */
  grouser_path_point point;
} grouser_foot;

/* The point at an arc length in m: an open path goes on straight past its ends, a closed one wraps. */
grouser_path_point grouser_path_at(const grouser_path *path, double arc_length);

/* The foot of (x, y) within `window` m of the arc length `near` of a former foot. Every number must be finite. */
grouser_foot grouser_path_project(const grouser_path *path, double x, double y, double near, double window);

#endif
