#include "grouser/physics.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

/* Share of an element's static load below which cohesion fades with the contact. */
static const double COHESION_FADE = 0.05;

static const char *const RIGID_COLUMNS[] = {GROUSER_RIGID_COLUMNS};
static const char *const SOIL_COLUMNS[] = {GROUSER_SOIL_COLUMNS};

/* Normal load of one track and its derivative by ay: W/2 -+ m ay h/B, clipped to [0, W]. */
static double side_load(const grouser_physics *block, double ay, enum grouser_side side, double *by_ay) {
  const double weight = block->mass * block->gravity;
  const double slope = (side == GROUSER_LEFT ? -1.0 : 1.0) * (block->mass * block->cg_height / block->tread);
  const double load = weight / 2 + slope * ay;
  *by_ay = load > 0 && load < weight ? slope : 0.0;
  return load < 0 ? 0.0 : load > weight ? weight : load;
}

/* Shares of the track's load by element, clipped at 0 and rescaled, and their derivatives by ax. */
static void element_shares(const grouser_physics *block, double ax, double *share, double *by_ax) {
  const int count = block->wheels;
  const double length = block->contact_length / count;
  const double lean_slope = -block->cg_height / block->gravity;
  const double lean = lean_slope * ax - block->contact_center;
  double spread = 0, total = 0, total_slope = 0;
  for (int i = 0; i < count; i++) {
    const double arm = (i - (count - 1) / 2.0) * length;
    spread += arm * arm;
  }
  for (int i = 0; i < count; i++) {
    const double gain = spread > 0 ? (i - (count - 1) / 2.0) * length / spread : 0.0;
    const double raw = 1.0 / count + gain * lean;
    share[i] = raw > 0 ? raw : 0.0;
    by_ax[i] = raw > 0 ? gain * lean_slope : 0.0;
    total += share[i];
    total_slope += by_ax[i];
  }
  for (int i = 0; i < count; i++) {
    share[i] /= total;
    by_ax[i] = (by_ax[i] - share[i] * total_slope) / total;
  }
}

/* Shear strength of one element and its derivatives by load and by the strength parameters. */
typedef struct {
  double stress, by_load, by_parameter[2];
} strength;

static strength shear_strength(const grouser_physics *block, const double *terrain, double load) {
  const double area = block->contact_length / block->wheels * block->track_width;
  const double pressure = load / area;
  strength s = {0, 0, {0, 0}};
  if (block->mode == GROUSER_RIGID) {
    s.stress = terrain[0] * pressure;
    s.by_load = terrain[0] / area;
    s.by_parameter[0] = pressure;
  } else {
    const double full_contact = COHESION_FADE * block->mass * block->gravity / (2 * block->wheels);
    const double fade = load < full_contact ? load / full_contact : 1.0;
    const double tangent = tan(terrain[1]);
    s.stress = terrain[0] * fade + pressure * tangent;
    s.by_load = (load < full_contact ? terrain[0] / full_contact : 0.0) + tangent / area;
    s.by_parameter[0] = fade;
    s.by_parameter[1] = pressure * (1 + tangent * tangent);
  }
  return s;
}

/* phi1(z) = (1 - exp(-z))/z; decay receives exp(-z). The series avoids the cancellation at small z. */
static double shear_factor(double z, double *decay) {
  if (z < 0.5) {
    double sum = 1.0;
    for (int n = 14; n > 1; n--) sum = 1.0 - sum * z / n;
    *decay = 1.0 - z * sum;
    return sum;
  }
  *decay = exp(-z);
  return (1.0 - *decay) / z;
}

/* Sums over an element's cells at unit shear strength: the force, and its derivatives by five of the inputs. */
enum { BY_VX, BY_VY, BY_YAW_RATE, BY_BELT, BY_MODULUS, SLOPES };

typedef struct {
  double force[GROUSER_OUTPUTS];
  double slope[SLOPES][GROUSER_OUTPUTS];
} element_sums;

static void add_force(double sum[GROUSER_OUTPUTS], double x, double y, double fx, double fy) {
  sum[0] += fx;
  sum[1] += fy;
  sum[2] += x * fy - y * fx;
}

static void integrate_element(const grouser_physics *block, const double *row, double belt, double sign,
                              double center, int want_slopes, element_sums *sums) {
  const double vx = row[GROUSER_VX], vy = row[GROUSER_VY], yaw_rate = row[GROUSER_YAW_RATE];
  const double modulus = row[grouser_columns(block->mode) - 1];
  const double length = block->contact_length / block->wheels;
  const double soft_belt = sqrt(belt * belt + block->soft_speed * block->soft_speed);
  const double direction = belt / soft_belt;
  const double direction_slope = block->soft_speed * block->soft_speed / (soft_belt * soft_belt * soft_belt);

  memset(sums, 0, sizeof *sums);
  for (int i = 0; i < block->along; i++) {
    const double offset = ((i + 0.5) / block->along - 0.5) * length;
    const double x = center + offset;
    const int continuous = block->contact == GROUSER_CONTINUOUS;
    const double reach = continuous ? x - block->contact_center : offset;
    const double travelled = (continuous ? block->contact_length : length) / 2 - direction * reach;
    const double stretch = travelled / soft_belt / modulus;
    const double stretch_slope = -direction_slope * reach / travelled - direction / soft_belt;
    const double slip_y = vy + yaw_rate * x;
    for (int j = 0; j < block->across; j++) {
      const double y =
          sign * (block->tread / 2 + ((j + 0.5) / block->across - 0.5) * block->track_width);
      const double slip_x = vx - yaw_rate * y - belt;
      const double ux = stretch * slip_x, uy = stretch * slip_y;
      const double z = sqrt(ux * ux + uy * uy);
      double decay;
      const double factor = shear_factor(z, &decay);
      add_force(sums->force, x, y, -factor * ux, -factor * uy);
      if (!want_slopes) continue;
      /* dF = -(phi1 I + (exp(-z) - phi1) n n') du, n = u/|u|; along u itself the bracket is exp(-z). */
      const double inverse = z > 0 ? 1 / z : 0.0;
      const double nx = ux * inverse, ny = uy * inverse, bend = decay - factor;
      const double gxx = stretch * (factor + bend * nx * nx);
      const double gxy = stretch * bend * nx * ny;
      const double gyy = stretch * (factor + bend * ny * ny);
      const double along_x = decay * ux, along_y = decay * uy;
      add_force(sums->slope[BY_VX], x, y, -gxx, -gxy);
      add_force(sums->slope[BY_VY], x, y, -gxy, -gyy);
      add_force(sums->slope[BY_YAW_RATE], x, y, y * gxx - x * gxy, y * gxy - x * gyy);
      add_force(sums->slope[BY_BELT], x, y, gxx - stretch_slope * along_x, gxy - stretch_slope * along_y);
      add_force(sums->slope[BY_MODULUS], x, y, along_x / modulus, along_y / modulus);
    }
  }
}

void grouser_physics_track(const grouser_physics *block, const double *x, enum grouser_side side,
                           double force[GROUSER_OUTPUTS], double *jacobian) {
  const int columns = grouser_columns(block->mode);
  const double *terrain = x + GROUSER_TERRAIN;
  const double rolling = x[columns - 2];
  const int belt_column = side == GROUSER_LEFT ? GROUSER_V_LEFT : GROUSER_V_RIGHT;
  const int strength_columns = columns - GROUSER_TERRAIN - 2;
  const double belt = x[belt_column];
  const double sign = side == GROUSER_LEFT ? 1.0 : -1.0;
  const double length = block->contact_length / block->wheels;
  const double cell_area = length * block->track_width / (block->along * block->across);
  const double soft_square = block->soft_speed * block->soft_speed;
  const double soft_belt = sqrt(belt * belt + soft_square);
  const double direction = belt / soft_belt;
  const double lever = sign * block->tread / 2;

  double share[GROUSER_MAX_WHEELS], share_by_ax[GROUSER_MAX_WHEELS], load_by_ay;
  const double track_load = side_load(block, x[GROUSER_AY], side, &load_by_ay);
  element_shares(block, x[GROUSER_AX], share, share_by_ax);

  const double resistance = -rolling * track_load * direction;
  force[0] = resistance;
  force[1] = 0;
  force[2] = -lever * resistance;
  if (jacobian) {
    memset(jacobian, 0, sizeof(double) * GROUSER_OUTPUTS * columns);
    const double by[3] = {-rolling * load_by_ay * direction,
                          -rolling * track_load * soft_square / (soft_belt * soft_belt * soft_belt),
                          -track_load * direction};
    const int column[3] = {GROUSER_AY, belt_column, columns - 2};
    for (int n = 0; n < 3; n++) {
      jacobian[column[n]] += by[n];
      jacobian[2 * columns + column[n]] -= lever * by[n];
    }
  }

  for (int i = 0; i < block->wheels; i++) {
    const double load = track_load * share[i];
    const strength s = shear_strength(block, terrain, load);
    const double center = block->contact_center + (i - (block->wheels - 1) / 2.0) * length;
    element_sums sums;
    integrate_element(block, x, belt, sign, center, jacobian != NULL, &sums);
    const double scale = s.stress * cell_area;
    for (int n = 0; n < GROUSER_OUTPUTS; n++) force[n] += scale * sums.force[n];
    if (!jacobian) continue;
    for (int n = 0; n < GROUSER_OUTPUTS; n++) {
      double *slope = jacobian + n * columns;
      const double unit = sums.force[n] * cell_area;
      slope[GROUSER_VX] += scale * sums.slope[BY_VX][n];
      slope[GROUSER_VY] += scale * sums.slope[BY_VY][n];
      slope[GROUSER_YAW_RATE] += scale * sums.slope[BY_YAW_RATE][n];
      slope[belt_column] += scale * sums.slope[BY_BELT][n];
      slope[columns - 1] += scale * sums.slope[BY_MODULUS][n];
      slope[GROUSER_AX] += unit * s.by_load * track_load * share_by_ax[i];
      slope[GROUSER_AY] += unit * s.by_load * load_by_ay * share[i];
      for (int p = 0; p < strength_columns; p++) slope[GROUSER_TERRAIN + p] += unit * s.by_parameter[p];
    }
  }
}

void grouser_physics_forces(const grouser_physics *block, const double *x, double force[GROUSER_OUTPUTS],
                            double *jacobian) {
  const int entries = GROUSER_OUTPUTS * grouser_columns(block->mode);
  double right[GROUSER_OUTPUTS], right_jacobian[GROUSER_OUTPUTS * GROUSER_MAX_COLUMNS];
  grouser_physics_track(block, x, GROUSER_LEFT, force, jacobian);
  grouser_physics_track(block, x, GROUSER_RIGHT, right, jacobian ? right_jacobian : NULL);
  for (int n = 0; n < GROUSER_OUTPUTS; n++) force[n] += right[n];
  if (jacobian)
    for (int n = 0; n < entries; n++) jacobian[n] += right_jacobian[n];
}

const char *grouser_physics_refuses(const grouser_physics *block, const double *x) {
  const char *const *names = block->mode == GROUSER_RIGID ? RIGID_COLUMNS : SOIL_COLUMNS;
  const int columns = grouser_columns(block->mode);
  for (int n = 0; n < columns; n++)
    if (!isfinite(x[n])) return names[n];
  if (!(x[columns - 1] > 0)) return names[columns - 1];
  if (block->soft_speed == 0) {
    if (x[GROUSER_V_LEFT] == 0) return names[GROUSER_V_LEFT];
    if (x[GROUSER_V_RIGHT] == 0) return names[GROUSER_V_RIGHT];
  }
  return NULL;
}
