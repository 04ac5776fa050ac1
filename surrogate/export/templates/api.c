/* ---- what the header declares ---- */
const char grouser_artifact_hash[65] = "$hash";
const char *const grouser_column_names[GROUSER_COLUMNS] = $names;

int grouser_abi_version(void) { return GROUSER_ABI_VERSION; }

int grouser_abi_matches(int version) { return version == GROUSER_ABI_VERSION; }

int grouser_refused_column(const double x[GROUSER_COLUMNS]) {
  const char *name = grouser_physics_refuses(&physics, x);
  if (!name) return -1;
  for (int n = 0; n < GROUSER_COLUMNS; n++)
    if (strcmp(name, grouser_column_names[n]) == 0) return n;
  return GROUSER_COLUMNS;
}

int grouser_surrogate_forces(const double x[GROUSER_COLUMNS], double force[GROUSER_OUTPUTS], double *jacobian) {
  if (grouser_physics_refuses(&physics, x)) return GROUSER_REFUSED;
  primary.evaluate(primary.self, x, force, jacobian);
  return 0;
}

int grouser_fallback_forces(const double x[GROUSER_COLUMNS], double force[GROUSER_OUTPUTS], double *jacobian) {
  if (grouser_physics_refuses(&physics, x)) return GROUSER_REFUSED;
  fallback.evaluate(fallback.self, x, force, jacobian);
  return 0;
}

grouser_detection grouser_score(const double x[GROUSER_COLUMNS]) { return grouser_detect(&guard.detector, x); }

grouser_guard_state grouser_fresh_guard(void) { return grouser_guard_fresh(); }

/* Advances a guard by a detection and evaluates whom it chose; 0 where the primary failed. */
static int evaluate_guarded(const grouser_guard_state *before, const grouser_detection *detection, double elapsed,
                            const double *x, grouser_guard_state *after, double *force,
                            double slopes[GROUSER_OUTPUTS][3]) {
  *after = grouser_guard_advance(&guard.policy, before, detection, elapsed);
  grouser_blend blend = {&primary, guard.fallback, after->fallback_weight, 0};
  grouser_blend_forces(&blend, x, NULL, force, slopes);
  return !blend.primary_failed;
}

int grouser_guarded_forces(grouser_guard_state *state, double elapsed, const double x[GROUSER_COLUMNS],
                           double force[GROUSER_OUTPUTS], double *body_jacobian, grouser_detection *detection) {
  double slopes[GROUSER_OUTPUTS][3];
  grouser_guard_state after;
  if (!(elapsed >= 0) || grouser_physics_refuses(&physics, x)) return GROUSER_REFUSED;
  *detection = grouser_detect(&guard.detector, x);
  if (!evaluate_guarded(state, detection, elapsed, x, &after, force, slopes)) {
    /* As in a tick: a primary that fails is taken for a row that it must not see. */
    detection->score = INFINITY;
    detection->reason = GROUSER_FINITE;
    detection->worst_column = GROUSER_PRIMARY_OUTPUT;
    evaluate_guarded(state, detection, elapsed, x, &after, force, slopes);
  }
  if (body_jacobian) memcpy(body_jacobian, slopes, sizeof slopes);
  *state = after;
  return 0;
}

grouser_vehicle_state grouser_at_rest(void) { return grouser_vehicle_at_rest(); }

int grouser_vehicle_tick(enum grouser_source source, double seconds, const double command[2],
                         const double terrain[GROUSER_PARAMETERS], const double *slope, grouser_vehicle_state *state,
                         grouser_tick_record *record) {
  grouser_plant plant;
  grouser_ground ground;
  grouser_tick_record ignored;
  if (!(seconds > 0 && seconds <= 1) || !(fabs(command[0]) <= GROUSER_MAXIMUM_SPEED) ||
      !(fabs(command[1]) <= GROUSER_MAXIMUM_SPEED))
    return GROUSER_REFUSED;
  grouser_plant_init(&plant, &vehicle, source == GROUSER_FALLBACK_ALONE ? &fallback : &primary,
                     source == GROUSER_GUARDED ? &guard : NULL, 0, GROUSER_IMPLICIT, seconds,
                     source == GROUSER_FALLBACK_ALONE ? FALLBACK_TOLERANCE : SURROGATE_TOLERANCE);
  memset(&ground, 0, sizeof ground);
  ground.parameters = GROUSER_PARAMETERS;
  memcpy(ground.theta[0], terrain, sizeof(double) * GROUSER_PARAMETERS);
  memcpy(ground.theta[1], terrain, sizeof(double) * GROUSER_PARAMETERS);
  if (slope) {
    ground.slope_x = slope[0];
    ground.slope_y = slope[1];
  }
  return (int)grouser_tick(&plant, &ground, command, state, record ? record : &ignored);
}
