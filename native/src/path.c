#include "grouser/path.h"

#include <math.h>

static double clamp(double value, double low, double high) { return fmin(fmax(value, low), high); }

static double hermite(double u, double step, double start, double end, double slope0, double slope1) {
  const double v = 1.0 - u;
  return v * v * (1.0 + 2.0 * u) * start + u * u * (3.0 - 2.0 * u) * end + step * u * v * (v * slope0 - u * slope1);
}

/* Laps and the rest of an arc length on a closed path, rounded as Python's divmod rounds them. */
static double wrap(double arc_length, double length, double *inside) {
  double rest = fmod(arc_length, length);
  double quotient = (arc_length - rest) / length;
  if (rest < 0.0) {
    rest += length;
    quotient -= 1.0;
  }
  double lap = floor(quotient);
  if (quotient - lap > 0.5) lap += 1.0;
  *inside = rest;
  return lap;
}

grouser_path_point grouser_path_at(const grouser_path *path, double arc_length) {
  double s = arc_length, turned = 0.0;
  if (path->closed) {
    turned = wrap(arc_length, path->length, &s) * path->turn;
  } else if (s < 0.0 || s > path->length) {
    const grouser_path_node *end = &path->nodes[s < 0.0 ? 0 : path->count - 1];
    const double beyond = s < 0.0 ? s : s - path->length;
    return (grouser_path_point){end->x + beyond * end->cosine, end->y + beyond * end->sine, end->heading, 0.0};
  }
  long index = (long)(s / path->step);
  if (index > path->count - 2) index = path->count - 2;
  const double u = s / path->step - (double)index;
  const grouser_path_node *a = &path->nodes[index], *b = a + 1;
  return (grouser_path_point){hermite(u, path->step, a->x, b->x, a->cosine, b->cosine),
                              hermite(u, path->step, a->y, b->y, a->sine, b->sine),
                              a->heading + u * (b->heading - a->heading) + turned,
                              a->curvature + u * (b->curvature - a->curvature)};
}

/* Index of the node nearest to (x, y) in [first, stop), counted on over the laps of a closed path. */
static long nearest_node(const grouser_path *path, double x, double y, long first, long stop) {
  const long last = path->count - 1;
  long wrapped = first % last, nearest = first;
  if (wrapped < 0) wrapped += last;
  double least = INFINITY;
  for (long index = first; index < stop; index++) {
    /* Only a closed path has to wrap; an open one ends with its last node. */
    const grouser_path_node *node = &path->nodes[path->closed ? wrapped : index];
    const double dx = node->x - x, dy = node->y - y, distance = dx * dx + dy * dy;
    if (distance < least) {
      least = distance;
      nearest = index;
    }
    if (++wrapped == last) wrapped = 0;
  }
  return nearest;
}

grouser_foot grouser_path_project(const grouser_path *path, double x, double y, double near, double window) {
  const long last = path->count - 1;
  const double share = ceil(window / path->step);
  long reach = share < (double)last ? (long)share : last;
  if (reach < 1) reach = 1;
  /* Halves round to even, as Python's round does. */
  const double node = nearbyint(near / path->step);
  long first, stop;
  if (path->closed) {
    if (reach > last / 2) reach = last / 2;
    const long middle = (long)node;
    first = middle - reach;
    stop = middle + reach + 1;
  } else {
    const long middle = (long)clamp(node, 0.0, (double)last);
    first = middle > reach ? middle - reach : 0;
    stop = middle + reach < last ? middle + reach + 1 : last + 1;
  }
  const long nearest = nearest_node(path, x, y, first, stop);

  /* Newton on (p - c(s)) t(s) = 0; the foot lies within a step of the nearest node, or past an open end. */
  double s = (double)nearest * path->step;
  const double low = nearest == 0 && !path->closed ? -INFINITY : s - path->step;
  const double high = nearest == last && !path->closed ? INFINITY : s + path->step;
  grouser_foot foot = {0};
  for (int iteration = 0; iteration < 4; iteration++) {
    foot.point = grouser_path_at(path, s);
    const double cosine = cos(foot.point.heading), sine = sin(foot.point.heading);
    const double dx = x - foot.point.x, dy = y - foot.point.y, along = dx * cosine + dy * sine;
    foot.cross_track = dy * cosine - dx * sine;
    const double moved = clamp(s + along / fmax(1.0 - foot.point.curvature * foot.cross_track, 0.2), low, high);
    if (fabs(moved - s) < 1e-9) break;
    s = moved;
  }
  foot.arc_length = s;
  return foot;
}
