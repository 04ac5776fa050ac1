#include "grouser/track_net.h"

#include <math.h>
#include <string.h>

#include "cpu.h"
#include "exponential.h"
#include "load.h"

/* What a track's features are differentiated by: columns of the mirrored track, then the shear modulus. */
enum { BY_VX, BY_VY, BY_YAW_RATE, BY_BELT, BY_MODULUS, DIRECTIONS };

/* A number with its derivatives. */
typedef struct {
  double v, d[DIRECTIONS];
} dual;

static dual variable(double value, int direction) {
  dual r = {value, {0}};
  r.d[direction] = 1;
  return r;
}

static dual scaled(double gain, dual a) {
  dual r = {gain * a.v, {0}};
  for (int q = 0; q < DIRECTIONS; q++) r.d[q] = gain * a.d[q];
  return r;
}

static dual add(dual a, dual b) {
  dual r = {a.v + b.v, {0}};
  for (int q = 0; q < DIRECTIONS; q++) r.d[q] = a.d[q] + b.d[q];
  return r;
}

static dual multiply(dual a, dual b) {
  dual r = {a.v * b.v, {0}};
  for (int q = 0; q < DIRECTIONS; q++) r.d[q] = a.d[q] * b.v + a.v * b.d[q];
  return r;
}

/* f(a), given f and f' there. */
static dual chained(dual a, double value, double slope) {
  dual r = {value, {0}};
  for (int q = 0; q < DIRECTIONS; q++) r.d[q] = slope * a.d[q];
  return r;
}

/* sqrt(square), exactly 0 where it vanishes, with a finite derivative. */
static dual root(dual square) {
  const double value = sqrt(square.v + 1e-300);
  return chained(square, value - 1e-150, 0.5 / value);
}

/* phi1(z) = (1 - exp(-z))/z and its slope. */
static dual shear_factor(dual z) {
  if (!(z.v > 1e-12)) return chained(z, 1.0 - z.v / 2, -0.5);
  const double rise = -expm1(-z.v), value = rise / z.v;
  /* (exp(-z) - phi1)/z loses its digits below, where the series -1/2 + z/3 - z^2/8 has them. */
  const double slope = z.v < 1e-3 ? -0.5 + z.v * (1.0 / 3 - z.v / 8) : (1.0 - rise - value) / z.v;
  return chained(z, value, slope);
}

typedef struct {
  dual shear[GROUSER_SHEAR], feature[GROUSER_FEATURES], gate, direction;
} track_slip;

static void slip_of(const grouser_track_net *net, const double *x, enum grouser_side side, track_slip *slip) {
  const grouser_physics *block = &net->block;
  const double sign = side == GROUSER_LEFT ? 1.0 : -1.0;
  const double belt = x[side == GROUSER_LEFT ? GROUSER_V_LEFT : GROUSER_V_RIGHT];
  const double modulus = x[grouser_columns(block->mode) - 1];
  const dual vx = variable(x[GROUSER_VX], BY_VX), vy = variable(sign * x[GROUSER_VY], BY_VY);
  const dual yaw_rate = variable(sign * x[GROUSER_YAW_RATE], BY_YAW_RATE), vt = variable(belt, BY_BELT);
  const dual across = add(vy, scaled(block->contact_center, yaw_rate));
  const dual along = add(add(vx, scaled(-block->tread / 2, yaw_rate)), scaled(-1.0, vt));

  const double soft_square = block->soft_speed * block->soft_speed, soft_belt = sqrt(belt * belt + soft_square);
  const double direction = belt / soft_belt, per_meter = 1.0 / (soft_belt * modulus);
  dual s = {direction, {0}}, t = {per_meter, {0}};
  s.d[BY_BELT] = soft_square / (soft_belt * soft_belt * soft_belt);
  t.d[BY_BELT] = -per_meter * direction / soft_belt;
  t.d[BY_MODULUS] = -per_meter / modulus;

  const double width_square = block->track_width * block->track_width / 12;
  const dual spread = add(multiply(along, along), scaled(width_square, multiply(yaw_rate, yaw_rate)));
  dual end[2 * GROUSER_POINTS], size[2 * GROUSER_POINTS];
  for (int e = 0; e < 2 * GROUSER_POINTS; e++) {
    end[e] = add(across, scaled(net->ends[e], yaw_rate));
    size[e] = root(add(spread, multiply(end[e], end[e])));
  }
  const dual bend = scaled(net->part_length * net->part_length / 12, multiply(multiply(s, yaw_rate), t));
  for (int j = 0; j < GROUSER_POINTS; j++) {
    dual travelled = scaled(-net->reach[j], s);
    travelled.v += net->half_travel;
    travelled = multiply(travelled, t);
    const dual z = multiply(scaled(0.5, add(size[j], size[GROUSER_POINTS + j])), travelled);
    const dual factor = shear_factor(z);
    const dual gain = scaled(-1.0, multiply(travelled, factor));
    const dual decay = chained(z, 1.0 - z.v * factor.v, -exp(-z.v));
    slip->shear[j] = multiply(gain, along);
    slip->shear[GROUSER_POINTS + j] =
        add(multiply(decay, bend), multiply(gain, scaled(0.5, add(end[j], end[GROUSER_POINTS + j]))));
  }

  const dual turning = scaled(block->contact_length / 2, yaw_rate);
  const dual square = add(add(multiply(along, along), multiply(across, across)), multiply(turning, turning));
  const dual reach = scaled(net->half_travel, t);
  const dual z = multiply(root(square), reach);
  const dual scale = multiply(reach, shear_factor(z));
  slip->gate = chained(z, z.v * shear_factor(z).v, exp(-z.v));
  memcpy(slip->feature, slip->shear, sizeof slip->shear);
  slip->feature[GROUSER_SHEAR] = multiply(along, scale);
  slip->feature[GROUSER_SHEAR + 1] = multiply(across, scale);
  slip->feature[GROUSER_SHEAR + 2] = multiply(turning, scale);
  slip->feature[GROUSER_SHEAR + 3] = chained(z, z.v / (z.v + 4), 4 / ((z.v + 4) * (z.v + 4)));
  slip->feature[GROUSER_SHEAR + 4] = s;
  slip->direction = s;
}

/* The same without derivatives. */
typedef struct {
  double shear[GROUSER_SHEAR], feature[GROUSER_FEATURES], gate, direction;
} track_values;

GROUSER_CLONES
static void values_of(const grouser_track_net *net, const double *x, enum grouser_side side, track_values *values) {
  const grouser_physics *block = &net->block;
  const double sign = side == GROUSER_LEFT ? 1.0 : -1.0;
  const double belt = x[side == GROUSER_LEFT ? GROUSER_V_LEFT : GROUSER_V_RIGHT];
  const double yaw_rate = sign * x[GROUSER_YAW_RATE];
  const double across = sign * x[GROUSER_VY] + block->contact_center * yaw_rate;
  const double along = x[GROUSER_VX] - block->tread / 2 * yaw_rate - belt;
  const double soft_belt = sqrt(belt * belt + block->soft_speed * block->soft_speed);
  const double direction = belt / soft_belt;
  const double per_meter = 1.0 / (soft_belt * x[grouser_columns(block->mode) - 1]);
  const double spread =
      along * along + block->track_width * block->track_width / 12 * (yaw_rate * yaw_rate) + 1e-300;
  const double bend = net->part_length * net->part_length / 12 * (direction * yaw_rate * per_meter);
  double end[2 * GROUSER_POINTS], size[2 * GROUSER_POINTS];
  for (int e = 0; e < 2 * GROUSER_POINTS; e++) {
    end[e] = across + net->ends[e] * yaw_rate;
    size[e] = sqrt(spread + end[e] * end[e]);
  }
  for (int j = 0; j < GROUSER_POINTS; j++) {
    const double travelled = (net->half_travel - net->reach[j] * direction) * per_meter;
    const double z = 0.5 * (size[j] + size[GROUSER_POINTS + j]) * travelled;
    const double rise = expm1_negative(z);
    const double gain = z > 0 ? rise / (z > 0 ? z : 1.0) * travelled : -travelled;
    values->shear[j] = gain * along;
    values->shear[GROUSER_POINTS + j] = (1.0 + rise) * bend + gain * (0.5 * (end[j] + end[GROUSER_POINTS + j]));
  }
  const double turning = block->contact_length / 2 * yaw_rate;
  const double reach = net->half_travel * per_meter;
  const double z = (sqrt(along * along + across * across + turning * turning + 1e-300) - 1e-150) * reach;
  const double gate = -expm1_negative(z), scale = z > 0 ? gate / z * reach : reach;
  memcpy(values->feature, values->shear, sizeof values->shear);
  values->feature[GROUSER_SHEAR] = along * scale;
  values->feature[GROUSER_SHEAR + 1] = across * scale;
  values->feature[GROUSER_SHEAR + 2] = turning * scale;
  values->feature[GROUSER_SHEAR + 3] = z / (z + 4);
  values->feature[GROUSER_SHEAR + 4] = direction;
  values->gate = gate;
  values->direction = direction;
}

/* One force component as a sum over the units: its coefficient of unit `u` at unit strength. */
static double lever(const grouser_physics *block, int component, int unit) {
  const int element = unit % block->wheels, kind = unit / block->wheels;
  if (component < 2) return kind == component ? 1.0 : 0.0;
  if (kind == 0) return -block->tread / 2;
  return kind == 1 ? block->contact_center + grouser_element_arm(block, element) : block->element_length / 2;
}

void grouser_track_net_track(const grouser_track_net *net, const double *x, enum grouser_side side,
                             double force[GROUSER_OUTPUTS], double *jacobian) {
  const grouser_physics *block = &net->block;
  const int columns = grouser_columns(block->mode), wheels = block->wheels, units = 3 * wheels;
  const double area = block->element_length * block->track_width, rolling = x[columns - 2];
  track_values values;
  values_of(net, x, side, &values);

  float input[GROUSER_FEATURES], output[GROUSER_MAX_WIDTH];
  grouser_slopes slopes;
  for (int f = 0; f < GROUSER_FEATURES; f++)
    input[f] = (float)((values.feature[f] - net->input_mean[f]) / net->input_scale[f]);
  grouser_dense_forward(&net->dense, input, output, slopes);

  double correction[GROUSER_MAX_UNITS], unit[GROUSER_MAX_UNITS];
  for (int u = 0; u < units; u++) {
    correction[u] = net->output_mean[u] + net->output_scale[u] * (double)output[u];
    unit[u] = values.gate * correction[u];
  }
  for (int k = 0; k < GROUSER_SHEAR; k++)
    for (int u = 0; u < units; u++) unit[u] += values.shear[k] * net->weights[k * units + u];

  double share[GROUSER_MAX_WHEELS], share_by_ax[GROUSER_MAX_WHEELS], load_by_ay;
  grouser_strength strength[GROUSER_MAX_WHEELS];
  const double load = grouser_side_load(block, x[GROUSER_AY], side, &load_by_ay);
  const double tangent = grouser_friction_tangent(block, x + GROUSER_TERRAIN);
  grouser_element_shares(block, x[GROUSER_AX], share, share_by_ax);

  const double half_tread = block->tread / 2;
  double fx = -rolling * load * values.direction, fy = 0, moment = 0;
  for (int i = 0; i < wheels; i++) {
    strength[i] = grouser_shear_strength(block, x + GROUSER_TERRAIN, tangent, load * share[i]);
    strength[i].stress *= area;
    const double arm = block->contact_center + grouser_element_arm(block, i);
    const double across = unit[wheels + i];
    fx += strength[i].stress * unit[i];
    fy += strength[i].stress * across;
    moment += strength[i].stress * (arm * across + block->element_length / 2 * unit[2 * wheels + i]);
  }
  /* Rows and columns that change their sign between a track and its mirror image. */
  const double sign = side == GROUSER_LEFT ? 1.0 : -1.0;
  force[0] = fx;
  force[1] = sign * fy;
  force[2] = sign * (moment - half_tread * fx);
  if (!jacobian) return;

  track_slip slip;
  slip_of(net, x, side, &slip);
  float rows[GROUSER_SEEDS * GROUSER_MAX_WIDTH] = {0};
  double by_shear[GROUSER_OUTPUTS][GROUSER_SHEAR] = {{0}}, by_gate[GROUSER_OUTPUTS] = {0};
  for (int n = 0; n < GROUSER_OUTPUTS; n++)
    for (int u = 0; u < units; u++) {
      const double seed = strength[u % wheels].stress * lever(block, n, u);
      rows[n * GROUSER_MAX_WIDTH + u] = (float)(seed * slip.gate.v * net->output_scale[u]);
      by_gate[n] += seed * correction[u];
      for (int k = 0; k < GROUSER_SHEAR; k++) by_shear[n][k] += seed * net->weights[k * units + u];
    }
  grouser_dense_backward(&net->dense, slopes, rows);

  memset(jacobian, 0, sizeof(double) * GROUSER_OUTPUTS * (size_t)columns);
  const int belt_column = side == GROUSER_LEFT ? GROUSER_V_LEFT : GROUSER_V_RIGHT;
  const int column[DIRECTIONS] = {GROUSER_VX, GROUSER_VY, GROUSER_YAW_RATE, belt_column, columns - 1};
  const double column_sign[DIRECTIONS] = {1, sign, sign, 1, 1};
  for (int n = 0; n < GROUSER_OUTPUTS; n++) {
    double *slope = jacobian + n * columns;
    const double row_sign = n == 0 ? 1.0 : sign;
    const double resistance_lever = n == 0 ? 1.0 : n == 2 ? -half_tread : 0.0;
    for (int q = 0; q < DIRECTIONS; q++) {
      double sum = by_gate[n] * slip.gate.d[q] - resistance_lever * rolling * load * slip.direction.d[q];
      for (int k = 0; k < GROUSER_SHEAR; k++) sum += by_shear[n][k] * slip.shear[k].d[q];
      for (int f = 0; f < GROUSER_FEATURES; f++)
        sum += (double)rows[n * GROUSER_MAX_WIDTH + f] / net->input_scale[f] * slip.feature[f].d[q];
      slope[column[q]] = row_sign * column_sign[q] * sum;
    }
    slope[GROUSER_AY] -= row_sign * resistance_lever * rolling * load_by_ay * slip.direction.v;
    slope[columns - 2] -= row_sign * resistance_lever * load * slip.direction.v;
    for (int u = 0; u < units; u++) {
      const int i = u % wheels;
      const double gain = row_sign * area * lever(block, n, u) * unit[u];
      slope[GROUSER_AX] += gain * strength[i].by_load * load * share_by_ax[i];
      slope[GROUSER_AY] += gain * strength[i].by_load * load_by_ay * share[i];
      for (int p = 0; p < columns - GROUSER_TERRAIN - 2; p++)
        slope[GROUSER_TERRAIN + p] += gain * strength[i].by_parameter[p];
    }
  }
}

void grouser_track_net_forces(const grouser_track_net *net, const double *x, double force[GROUSER_OUTPUTS],
                              double *jacobian) {
  const int entries = GROUSER_OUTPUTS * grouser_columns(net->block.mode);
  double right[GROUSER_OUTPUTS], right_jacobian[GROUSER_OUTPUTS * GROUSER_MAX_COLUMNS];
  grouser_track_net_track(net, x, GROUSER_LEFT, force, jacobian);
  grouser_track_net_track(net, x, GROUSER_RIGHT, right, jacobian ? right_jacobian : NULL);
  for (int n = 0; n < GROUSER_OUTPUTS; n++) force[n] += right[n];
  if (jacobian)
    for (int n = 0; n < entries; n++) jacobian[n] += right_jacobian[n];
}
