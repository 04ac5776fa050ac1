/* The shear at one point along a track of the structured surrogate, with its derivatives: plain arithmetic without
 * branches, for loops over points or over vehicles that are to be vectorised. The track is mirrored to the left. */
#ifndef GROUSER_SHEAR_POINT_H
#define GROUSER_SHEAR_POINT_H

#include <math.h>

#include "exponential.h"

/* Below any speed squared; keeps the derivatives of a length finite at zero. */
#define GROUSER_TINY_SQUARE 1e-300
#define GROUSER_TINY 1e-150

/* What is the same for all points of a track. */
typedef struct {
  double along, across, yaw_rate; /* slip velocity along at the middle; body velocity across there; yaw rate */
  double soft_belt, direction, direction_slope;
  double per_meter, modulus;      /* 1/(K soft_belt), K */
} grouser_slip;

/* What is the same for all rows: levers of the yaw rate, and the part of the track that the point stands for. */
typedef struct {
  double half_tread, center, width_square; /* width_square: of the track, over 12 */
  double rear, front, reach, half_travel, part_square; /* part_square: of the part, over 12 */
} grouser_part;

/* Shear along (x) and across (y), each by vx, vy, yaw rate, belt speed and K. */
typedef struct {
  double x, x_by_vx, x_by_vy, x_by_yaw, x_by_belt, x_by_modulus;
  double y, y_by_vx, y_by_vy, y_by_yaw, y_by_belt, y_by_modulus;
} grouser_shear_point;

/* Sets what the body's motion decides; the rest follows from belt and ground. */
static inline void grouser_move_slip(grouser_slip *s, double vx, double vy, double yaw_rate, double belt,
                                     double half_tread, double center) {
  s->along = vx - half_tread * yaw_rate - belt;
  s->across = vy + center * yaw_rate;
  s->yaw_rate = yaw_rate;
}

static inline grouser_slip grouser_slip_of(double vx, double vy, double yaw_rate, double belt, double modulus,
                                           double half_tread, double center, double soft_speed) {
  const double soft_square = soft_speed * soft_speed, soft_belt = sqrt(belt * belt + soft_square);
  grouser_slip s;
  grouser_move_slip(&s, vx, vy, yaw_rate, belt, half_tread, center);
  s.soft_belt = soft_belt;
  s.direction = belt / soft_belt;
  s.direction_slope = soft_square / (soft_belt * soft_belt * soft_belt);
  s.per_meter = 1.0 / (soft_belt * modulus);
  s.modulus = modulus;
  return s;
}

/* phi1(z) = (1 - exp(-z))/z from rise = exp(-z) - 1 and 1/z, and its slope. */
static inline double grouser_shear_factor(double z, double rise, double inverse) { return z > 0 ? -rise * inverse : 1.0; }

static inline double grouser_shear_factor_slope(double z, double rise, double factor, double inverse) {
  /* (exp(-z) - phi1)/z loses its digits below, where the series has them. */
  const double series = -0.5 + z * (1.0 / 3 - z * (0.125 - z / 30));
  return z < 1e-3 ? series : (1.0 + rise - factor) * inverse;
}

/* Size of the slip velocity at one end of a part, over the width of the track. */
static inline double grouser_slip_size(const grouser_slip s, double end, double width_square) {
  const double spread = s.along * s.along + width_square * (s.yaw_rate * s.yaw_rate) + GROUSER_TINY_SQUARE;
  const double across = s.across + end * s.yaw_rate;
  return sqrt(spread + across * across);
}

/* The shear at a point, from the sizes at the ends of its part. */
static inline grouser_shear_point grouser_shear_between(const grouser_slip s, const grouser_part p, double rear_size,
                                                        double front_size) {
  const double spread_by_yaw = p.width_square * s.yaw_rate - p.half_tread * s.along;
  const double rear = s.across + p.rear * s.yaw_rate, front = s.across + p.front * s.yaw_rate;
  const double by_both = 0.5 / (rear_size * front_size), by_rear = by_both * front_size, by_front = by_both * rear_size;
  const double size = 0.5 * (rear_size + front_size);
  const double size_by_vx = s.along * (by_rear + by_front), size_by_vy = rear * by_rear + front * by_front;
  const double size_by_yaw = (spread_by_yaw + rear * (p.center + p.rear)) * by_rear +
                             (spread_by_yaw + front * (p.center + p.front)) * by_front;

  const double length = p.half_travel - p.reach * s.direction;
  const double travelled = length * s.per_meter;
  const double travelled_by_belt =
      -(p.reach * s.direction_slope + length * s.direction / s.soft_belt) * s.per_meter;
  const double z = size * travelled;
  const double z_by_vx = size_by_vx * travelled, z_by_vy = size_by_vy * travelled, z_by_yaw = size_by_yaw * travelled;
  const double z_by_belt = size * travelled_by_belt - z_by_vx, z_by_modulus = -z / s.modulus;

  const double rise = expm1_negative(z), decay = 1.0 + rise, inverse = 1.0 / (z > 0 ? z : 1.0);
  const double factor = grouser_shear_factor(z, rise, inverse);
  const double factor_slope = grouser_shear_factor_slope(z, rise, factor, inverse);
  const double gain = travelled * factor, gain_by_z = travelled * factor_slope;
  const double gain_by_belt = travelled_by_belt * factor + gain_by_z * z_by_belt;
  const double gain_by_modulus = -gain / s.modulus + gain_by_z * z_by_modulus;
  const double curve = p.part_square * s.direction * s.per_meter, bend = curve * s.yaw_rate;
  const double bend_by_belt =
      p.part_square * s.yaw_rate * s.per_meter * (s.direction_slope - s.direction * s.direction / s.soft_belt);
  const double middle = 0.5 * (rear + front), middle_by_yaw = p.center + 0.5 * (p.rear + p.front);
  const double y_by_z = -decay * bend - gain_by_z * middle;

  grouser_shear_point j;
  j.x = -gain * s.along;
  j.x_by_vx = -gain_by_z * z_by_vx * s.along - gain;
  j.x_by_vy = -gain_by_z * z_by_vy * s.along;
  j.x_by_yaw = -gain_by_z * z_by_yaw * s.along + gain * p.half_tread;
  j.x_by_belt = -gain_by_belt * s.along + gain;
  j.x_by_modulus = -gain_by_modulus * s.along;
  j.y = decay * bend - gain * middle;
  j.y_by_vx = y_by_z * z_by_vx;
  j.y_by_vy = y_by_z * z_by_vy - gain;
  j.y_by_yaw = y_by_z * z_by_yaw + decay * curve - gain * middle_by_yaw;
  j.y_by_belt = -decay * bend * z_by_belt + decay * bend_by_belt - gain_by_belt * middle;
  j.y_by_modulus = -decay * bend * z_by_modulus - decay * bend / s.modulus - gain_by_modulus * middle;
  return j;
}

static inline grouser_shear_point grouser_shear_at(const grouser_slip s, const grouser_part p) {
  return grouser_shear_between(s, p, grouser_slip_size(s, p.rear, p.width_square),
                               grouser_slip_size(s, p.front, p.width_square));
}

/* The gate 1 - exp(-z) at the middle of the track, and z, with z by the same five. */
typedef struct {
  double gate, gate_by_z, z, z_by_vx, z_by_vy, z_by_yaw, z_by_belt, z_by_modulus;
} grouser_gate;

static inline grouser_gate grouser_gate_of(const grouser_slip s, double half_tread, double center, double half_length,
                                           double half_travel) {
  const double turning = half_length * s.yaw_rate;
  const double root = sqrt(s.along * s.along + s.across * s.across + turning * turning + GROUSER_TINY_SQUARE);
  const double by = half_travel * s.per_meter / root, reach = half_travel * s.per_meter;
  grouser_gate g;
  g.z = (root - GROUSER_TINY) * reach;
  const double rise = expm1_negative(g.z);
  g.gate = -rise;
  g.gate_by_z = 1.0 + rise;
  g.z_by_vx = s.along * by;
  g.z_by_vy = s.across * by;
  g.z_by_yaw = (center * s.across - half_tread * s.along + half_length * turning) * by;
  g.z_by_belt = -g.z_by_vx - g.z * s.direction / s.soft_belt;
  g.z_by_modulus = -g.z / s.modulus;
  return g;
}

#endif
