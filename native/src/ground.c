#include "grouser/ground.h"

#include <math.h>
#include <stddef.h>

/* Weights of three neighbouring cells, and their slopes by the position in cells. */
typedef struct {
  int first;
  double weight[3], slope[3];
} spline;

/* Beyond the map the weights stay as they are at its edge. */
static spline spline_at(double position, int count) {
  const double limited = fmin(fmax(position, 0.0), (double)count);
  const int cell = limited < count ? (int)limited : count - 1;
  const double u = limited - cell - 0.5;
  const spline s = {cell,
                    {0.5 * ((0.5 - u) * (0.5 - u)), 0.75 - u * u, 0.5 * ((0.5 + u) * (0.5 + u))},
                    {u - 0.5, -2.0 * u, u + 0.5}};
  const spline flat = {cell, {s.weight[0], s.weight[1], s.weight[2]}, {0, 0, 0}};
  return limited == position ? s : flat;
}

static int covers(const grouser_field *field, double x, double y) {
  return field->x <= x && x <= field->x + field->columns * field->spacing && field->y <= y &&
         y <= field->y + field->rows * field->spacing;
}

static void parameters_at(const grouser_field *field, const spline *along, const spline *across, double *theta) {
  const int count = field->parameters;
  const size_t pitch = (size_t)(field->columns + 2) * (size_t)count;
  const double *corner = field->theta + (size_t)across->first * pitch + (size_t)along->first * (size_t)count;
  const double *center = corner + pitch + count;
  for (int p = 0; p < count; p++) {
    /* Differences from the nearest cell, so that uniform ground is returned to the bit. */
    double sum = 0;
    for (int i = 0; i < 3; i++)
      for (int j = 0; j < 3; j++)
        sum += across->weight[i] * along->weight[j] * (corner[(size_t)i * pitch + (size_t)(j * count + p)] - center[p]);
    theta[p] = center[p] + sum;
  }
}

static void slope_at(const grouser_field *field, const spline *along, const spline *across, double slope[2]) {
  const size_t pitch = (size_t)(field->columns + 2);
  const double *corner = field->height + (size_t)across->first * pitch + (size_t)along->first;
  double by_x = 0, by_y = 0;
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++) {
      const double height = corner[(size_t)i * pitch + (size_t)j];
      by_x += across->weight[i] * along->slope[j] * height;
      by_y += across->slope[i] * along->weight[j] * height;
    }
  slope[0] = by_x / field->spacing;
  slope[1] = by_y / field->spacing;
}

int grouser_field_at(const grouser_field *field, double x, double y, double *theta, double slope[2]) {
  if (!(isfinite(x) && isfinite(y)) || (field->outside == GROUSER_REFUSE && !covers(field, x, y))) return 0;
  const spline along = spline_at((x - field->x) / field->spacing, field->columns);
  const spline across = spline_at((y - field->y) / field->spacing, field->rows);
  parameters_at(field, &along, &across, theta);
  if (slope) {
    slope[0] = slope[1] = 0;
    if (field->height) slope_at(field, &along, &across, slope);
  }
  return 1;
}

/* (g_x, g_y) = -g R(-psi) grad z / sqrt(1 + |grad z|^2), and the share of the weight g_z / g. */
static void stand_on_slope(const double slope[2], double gravity, double cosine, double sine,
                           grouser_footing *footing) {
  const double p = slope[0], q = slope[1];
  if (p == 0.0 && q == 0.0) {
    footing->pull_x = footing->pull_y = 0.0;
    footing->load_ratio = 1.0;
    return;
  }
  const double normal = gravity / sqrt(1.0 + p * p + q * q);
  footing->pull_x = -normal * (cosine * p + sine * q);
  footing->pull_y = -normal * (cosine * q - sine * p);
  footing->load_ratio = normal / gravity;
}

int grouser_sample_ground(const grouser_ground *ground, const grouser_sampling *sampling, double x, double y,
                          double cosine, double sine, grouser_footing *footing) {
  const grouser_field *field = ground->field;
  double slope[2] = {0.0, 0.0};
  footing->split = sampling->tracks;
  if (!field) {
    if (!(isfinite(x) && isfinite(y))) return 0;
    for (int p = 0; p < ground->parameters; p++) {
      footing->theta[0][p] = ground->theta[0][p];
      footing->theta[1][p] = ground->theta[1][p];
    }
  } else {
    if (!grouser_field_at(field, x, y, footing->theta[0], slope)) return 0;
    if (sampling->tracks) {
      const double middle_x = x + sampling->contact_center * cosine, middle_y = y + sampling->contact_center * sine;
      const double aside_x = sampling->tread / 2 * sine, aside_y = sampling->tread / 2 * cosine;
      if (!grouser_field_at(field, middle_x - aside_x, middle_y + aside_y, footing->theta[0], NULL) ||
          !grouser_field_at(field, middle_x + aside_x, middle_y - aside_y, footing->theta[1], NULL))
        return 0;
    }
  }
  slope[0] += ground->slope_x;
  slope[1] += ground->slope_y;
  stand_on_slope(slope, sampling->gravity, cosine, sine, footing);
  return 1;
}
