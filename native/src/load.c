#include "load.h"

#include <math.h>

double grouser_side_load(const grouser_physics *block, double ay, enum grouser_side side, double *by_ay) {
  const double weight = block->mass * block->gravity;
  const double slope = (side == GROUSER_LEFT ? -1.0 : 1.0) * (block->mass * block->cg_height / block->tread);
  const double load = weight / 2 + slope * ay;
  *by_ay = load > 0 && load < weight ? slope : 0.0;
  return load < 0 ? 0.0 : load > weight ? weight : load;
}

void grouser_element_shares(const grouser_physics *block, double ax, double *share, double *by_ax) {
  const int count = block->wheels;
  const double lean_slope = -block->cg_height / block->gravity;
  const double lean = lean_slope * ax - block->contact_center;
  double spread = 0, total = 0, total_slope = 0;
  for (int i = 0; i < count; i++) {
    const double arm = grouser_element_arm(block, i);
    spread += arm * arm;
  }
  const double per_spread = spread > 0 ? 1.0 / spread : 0.0;
  for (int i = 0; i < count; i++) {
    const double gain = grouser_element_arm(block, i) * per_spread;
    const double raw = 1.0 / count + gain * lean;
    share[i] = raw > 0 ? raw : 0.0;
    by_ax[i] = raw > 0 ? gain * lean_slope : 0.0;
    total += share[i];
    total_slope += by_ax[i];
  }
  const double per_total = 1.0 / total;
  for (int i = 0; i < count; i++) {
    share[i] *= per_total;
    by_ax[i] = (by_ax[i] - share[i] * total_slope) * per_total;
  }
}

double grouser_friction_tangent(const grouser_physics *block, const double *terrain) {
  return block->mode == GROUSER_SOIL ? tan(terrain[1]) : 0.0;
}

grouser_strength grouser_shear_strength(const grouser_physics *block, const double *terrain, double tangent,
                                        double load) {
  const double area = block->element_length * block->track_width;
  const double per_area = 1.0 / area, pressure = load * per_area;
  grouser_strength s = {0, 0, {0, 0}};
  if (block->mode == GROUSER_RIGID) {
    s.stress = terrain[0] * pressure;
    s.by_load = terrain[0] * per_area;
    s.by_parameter[0] = pressure;
  } else {
    const double full_contact = GROUSER_COHESION_FADE * block->mass * block->gravity / (2 * block->wheels);
    const double fade = load < full_contact ? load / full_contact : 1.0;
    s.stress = terrain[0] * fade + pressure * tangent;
    s.by_load = (load < full_contact ? terrain[0] / full_contact : 0.0) + tangent * per_area;
    s.by_parameter[0] = fade;
    s.by_parameter[1] = pressure * (1 + tangent * tangent);
  }
  return s;
}
