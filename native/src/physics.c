#include "grouser/physics.h"

#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "cpu.h"

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

/* Cells are taken in strips: long enough for the vector units, short enough for the stack. */
enum { LANES = 8, STRIP = 64 };

typedef struct {
  double offset[STRIP]; /* along the element, from its centre */
  double y[STRIP];      /* from the CG */
  double weight[STRIP]; /* 1, or 0 past the last cell */
  int lanes;            /* cells, rounded up to whole lanes */
} cell_strip;

static void fill_strip(const grouser_physics *block, double sign, int first, cell_strip *strip) {
  const int cells = block->along * block->across;
  const double length = block->contact_length / block->wheels;
  const int count = cells - first < STRIP ? cells - first : STRIP;
  strip->lanes = (count + LANES - 1) / LANES * LANES;
  for (int n = 0; n < strip->lanes; n++) {
    const int cell = n < count ? first + n : first;
    const int i = cell / block->across, j = cell % block->across;
    strip->offset[n] = ((i + 0.5) / block->along - 0.5) * length;
    strip->y[n] = sign * (block->tread / 2 + ((j + 0.5) / block->across - 0.5) * block->track_width);
    strip->weight[n] = n < count ? 1.0 : 0.0;
  }
}

/* exp(-z) - 1 for z >= 0, without branches: -z = k ln 2 + r, |r| <= ln 2 / 2, then 2^k expm1(r) + (2^k - 1).
 * The Taylor sum ends at r^13/13!, below 1e-17; at k = 0 the relative error stays at rounding. */
static inline double expm1_negative(double z) {
  static const double LOG2E = 1.4426950408889634074, LN2_HIGH = 6.93147180369123816490e-01,
                      LN2_LOW = 1.90821492927058770002e-10, SHIFT = 6755399441055744.0; /* 1.5 * 2^52 */
  const double minus = z < 700.0 ? -z : -700.0;
  const double shifted = minus * LOG2E + SHIFT;
  const double k = shifted - SHIFT;
  const double r = (minus - k * LN2_HIGH) - k * LN2_LOW;
  double p = 1.0 / 6227020800.0;
  p = p * r + 1.0 / 479001600.0;
  p = p * r + 1.0 / 39916800.0;
  p = p * r + 1.0 / 3628800.0;
  p = p * r + 1.0 / 362880.0;
  p = p * r + 1.0 / 40320.0;
  p = p * r + 1.0 / 5040.0;
  p = p * r + 1.0 / 720.0;
  p = p * r + 1.0 / 120.0;
  p = p * r + 1.0 / 24.0;
  p = p * r + 1.0 / 6.0;
  p = p * r + 0.5;
  const double series = r + r * r * p;
  uint64_t bits;
  double scale;
  memcpy(&bits, &shifted, sizeof bits);
  bits = (bits + 1023) << 52;
  memcpy(&scale, &bits, sizeof scale);
  return scale * series + (scale - 1.0);
}

/* What is the same for every cell under one element. */
typedef struct {
  double vx, vy, yaw_rate, belt;
  double center;           /* of the element, from the CG */
  double reach;            /* from the cell's offset to where the shear is counted from */
  double half_travel;      /* distance travelled at the middle of that length */
  double direction;        /* s */
  double direction_slope;  /* ds/dVt */
  double soft_belt;        /* sqrt(Vt^2 + V_eps^2) */
  double modulus;          /* K */
} element_motion;

/* Sums over an element's cells at unit shear strength: the force, and its derivatives by five of the inputs. */
enum { BY_VX, BY_VY, BY_YAW_RATE, BY_BELT, BY_MODULUS, SLOPES };

typedef struct {
  double force[GROUSER_OUTPUTS];
  double slope[SLOPES][GROUSER_OUTPUTS];
} element_sums;

static double lane_total(const double lane[LANES]) {
  return ((lane[0] + lane[4]) + (lane[2] + lane[6])) + ((lane[1] + lane[5]) + (lane[3] + lane[7]));
}

GROUSER_CLONES
static void add_forces(const element_motion *m, const cell_strip *strip, element_sums *sums) {
  double fx_lane[LANES] = {0}, fy_lane[LANES] = {0}, m_lane[LANES] = {0};
  const double gain = 1.0 / (m->soft_belt * m->modulus);
  for (int first = 0; first < strip->lanes; first += LANES) {
    for (int l = 0; l < LANES; l++) {
      const double offset = strip->offset[first + l], y = strip->y[first + l];
      const double x = m->center + offset;
      const double stretch = strip->weight[first + l] * (m->half_travel - m->direction * (offset + m->reach)) * gain;
      const double ux = stretch * (m->vx - m->yaw_rate * y - m->belt), uy = stretch * (m->vy + m->yaw_rate * x);
      const double z = sqrt(ux * ux + uy * uy);
      const double factor = z > 0 ? expm1_negative(z) / (z > 0 ? z : 1.0) : -1.0;
      const double fx = factor * ux, fy = factor * uy;
      fx_lane[l] += fx;
      fy_lane[l] += fy;
      m_lane[l] += x * fy - y * fx;
    }
  }
  sums->force[0] += lane_total(fx_lane);
  sums->force[1] += lane_total(fy_lane);
  sums->force[2] += lane_total(m_lane);
}

/* dF = -(phi1 I + (exp(-z) - phi1) n n') du, n = u/|u|; along u itself the bracket is exp(-z). The slopes by yaw rate
 * follow from those by vx and vy at the cell. */
GROUSER_CLONES
static void add_slopes(const element_motion *m, const cell_strip *strip, element_sums *sums) {
  double lane[SLOPES][GROUSER_OUTPUTS][LANES];
  memset(lane, 0, sizeof lane);
  const double gain = 1.0 / (m->soft_belt * m->modulus);
  const double inverse_modulus = 1.0 / m->modulus;
  for (int first = 0; first < strip->lanes; first += LANES) {
    for (int l = 0; l < LANES; l++) {
      const double offset = strip->offset[first + l], y = strip->y[first + l];
      const double x = m->center + offset;
      const double travelled = m->half_travel - m->direction * (offset + m->reach);
      const double stretch = strip->weight[first + l] * travelled * gain;
      const double stretch_slope =
          -m->direction_slope * (offset + m->reach) / travelled - m->direction / m->soft_belt;
      const double ux = stretch * (m->vx - m->yaw_rate * y - m->belt), uy = stretch * (m->vy + m->yaw_rate * x);
      const double z = sqrt(ux * ux + uy * uy);
      const double safe = z > 0 ? z : 1.0;
      const double rise = expm1_negative(z);
      const double factor = z > 0 ? -rise / safe : 1.0;
      const double decay = 1.0 + rise;
      const double nx = ux / safe, ny = uy / safe, bend = decay - factor;
      const double gxx = stretch * (factor + bend * nx * nx);
      const double gxy = stretch * bend * nx * ny;
      const double gyy = stretch * (factor + bend * ny * ny);
      const double wx = gxy * x - gxx * y, wy = gyy * x - gxy * y;
      const double along_x = decay * ux, along_y = decay * uy;
      const double bx = gxx - stretch_slope * along_x, by = gxy - stretch_slope * along_y;
      const double kx = along_x * inverse_modulus, ky = along_y * inverse_modulus;
      lane[BY_VX][0][l] -= gxx;
      lane[BY_VX][1][l] -= gxy;
      lane[BY_VX][2][l] -= x * gxy - y * gxx;
      lane[BY_VY][1][l] -= gyy;
      lane[BY_VY][2][l] -= x * gyy - y * gxy;
      lane[BY_YAW_RATE][0][l] -= wx;
      lane[BY_YAW_RATE][1][l] -= wy;
      lane[BY_YAW_RATE][2][l] -= x * wy - y * wx;
      lane[BY_BELT][0][l] += bx;
      lane[BY_BELT][1][l] += by;
      lane[BY_BELT][2][l] += x * by - y * bx;
      lane[BY_MODULUS][0][l] += kx;
      lane[BY_MODULUS][1][l] += ky;
      lane[BY_MODULUS][2][l] += x * ky - y * kx;
    }
  }
  memcpy(lane[BY_VY][0], lane[BY_VX][1], sizeof lane[BY_VY][0]);
  for (int s = 0; s < SLOPES; s++)
    for (int n = 0; n < GROUSER_OUTPUTS; n++) sums->slope[s][n] += lane_total(lane[s][n]);
}

/* Sums of every element of one track. */
static void integrate_track(const grouser_physics *block, const double *row, double belt, double sign, int want_slopes,
                            element_sums *sums) {
  const double length = block->contact_length / block->wheels;
  const double soft_square = block->soft_speed * block->soft_speed;
  const int continuous = block->contact == GROUSER_CONTINUOUS;
  element_motion m = {.vx = row[GROUSER_VX],
                      .vy = row[GROUSER_VY],
                      .yaw_rate = row[GROUSER_YAW_RATE],
                      .belt = belt,
                      .half_travel = (continuous ? block->contact_length : length) / 2,
                      .soft_belt = sqrt(belt * belt + soft_square),
                      .modulus = row[grouser_columns(block->mode) - 1]};
  m.direction = belt / m.soft_belt;
  m.direction_slope = soft_square / (m.soft_belt * m.soft_belt * m.soft_belt);
  memset(sums, 0, sizeof *sums * (size_t)block->wheels);
  for (int first = 0; first < block->along * block->across; first += STRIP) {
    cell_strip strip;
    fill_strip(block, sign, first, &strip);
    for (int i = 0; i < block->wheels; i++) {
      const double from_middle = (i - (block->wheels - 1) / 2.0) * length;
      m.center = block->contact_center + from_middle;
      m.reach = continuous ? from_middle : 0.0;
      /* Forces come from their own pass, so that they have the same bits with and without slopes. */
      add_forces(&m, &strip, &sums[i]);
      if (want_slopes) add_slopes(&m, &strip, &sums[i]);
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

  element_sums sums[GROUSER_MAX_WHEELS];
  integrate_track(block, x, belt, sign, jacobian != NULL, sums);
  for (int i = 0; i < block->wheels; i++) {
    const double load = track_load * share[i];
    const strength s = shear_strength(block, terrain, load);
    const double scale = s.stress * cell_area;
    for (int n = 0; n < GROUSER_OUTPUTS; n++) force[n] += scale * sums[i].force[n];
    if (!jacobian) continue;
    for (int n = 0; n < GROUSER_OUTPUTS; n++) {
      double *slope = jacobian + n * columns;
      const double unit = sums[i].force[n] * cell_area;
      slope[GROUSER_VX] += scale * sums[i].slope[BY_VX][n];
      slope[GROUSER_VY] += scale * sums[i].slope[BY_VY][n];
      slope[GROUSER_YAW_RATE] += scale * sums[i].slope[BY_YAW_RATE][n];
      slope[belt_column] += scale * sums[i].slope[BY_BELT][n];
      slope[columns - 1] += scale * sums[i].slope[BY_MODULUS][n];
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
