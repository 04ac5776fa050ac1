/* ---- self-test ---- */
$tables
static uint64_t add_floats(uint64_t sum, const float *values, int count) {
  for (int n = 0; n < count; n++) {
    uint32_t bits;
    memcpy(&bits, values + n, sizeof bits);
    sum = (sum ^ bits) * UINT64_C(1099511628211);
  }
  return sum;
}

static uint64_t add_doubles(uint64_t sum, const double *values, int count) {
  for (int n = 0; n < count; n++) {
    uint64_t bits;
    memcpy(&bits, values + n, sizeof bits);
    sum = (sum ^ bits) * UINT64_C(1099511628211);
  }
  return sum;
}

static uint64_t checksum(void) {
  uint64_t sum = UINT64_C(14695981039346656037);
$checksum_terms
  return sum;
}

/* Whether every value is within a share of its scale; an inequality that NaN fails. */
static int agree(const double *expected, const double *got, const double *scale, double share, int count) {
  for (int n = 0; n < count; n++)
    if (!(fabs(expected[n] - got[n]) <= share * scale[n])) return 0;
  return 1;
}

/* The same, each of three rows over its largest entry. */
static int jacobians_agree(const double *expected, const double *got) {
  for (int n = 0; n < GROUSER_OUTPUTS; n++) {
    double scale[GROUSER_COLUMNS], largest = 0;
    for (int i = 0; i < GROUSER_COLUMNS; i++) largest = fmax(largest, fabs(expected[n * GROUSER_COLUMNS + i]));
    for (int i = 0; i < GROUSER_COLUMNS; i++) scale[i] = largest;
    if (!agree(expected + n * GROUSER_COLUMNS, got + n * GROUSER_COLUMNS, scale, $jacobian_share, GROUSER_COLUMNS))
      return 0;
  }
  return 1;
}

/* Number of the failed check (forces, or the one after it), or 0. */
static int check_forces(const grouser_kernel *kernel, const double *forces, const double *jacobians,
                        const double *scale, double share, int number) {
  double force[GROUSER_OUTPUTS], jacobian[GROUSER_OUTPUTS * GROUSER_COLUMNS];
  for (int row = 0; row < GOLDEN_ROWS; row++) {
    kernel->evaluate(kernel->self, golden_rows + row * GROUSER_COLUMNS, force, NULL);
    if (!agree(forces + row * GROUSER_OUTPUTS, force, scale, share, GROUSER_OUTPUTS)) return number;
  }
  for (int row = 0; row < GOLDEN_JACOBIANS; row++) {
    kernel->evaluate(kernel->self, golden_rows + (row + 1) * GROUSER_COLUMNS, force, jacobian);
    if (!jacobians_agree(jacobians + row * GROUSER_OUTPUTS * GROUSER_COLUMNS, jacobian)) return number + 1;
  }
  return 0;
}

static int detector_agrees(void) {
  for (int row = 0; row < GOLDEN_ROWS; row++) {
    const double score = grouser_score(golden_rows + row * GROUSER_COLUMNS).score;
    if (!(fabs(score - golden_scores[row]) <= $score_share * golden_scores[row])) return 0;
  }
  return 1;
}

/* A drive of single rows, into the fallback and back. */
static int guard_agrees(void) {
  grouser_guard_state state = grouser_fresh_guard();
  for (int n = 0; n < GOLDEN_DRIVE; n++) {
    double force[GROUSER_OUTPUTS];
    grouser_detection detection;
    grouser_guarded_forces(&state, $elapsed, golden_rows + golden_drive[n] * GROUSER_COLUMNS, force, NULL, &detection);
    if ((int)state.mode != golden_modes[n] || !(fabs(state.fallback_weight - golden_weights[n]) <= 1e-12) ||
        !agree(golden_drive_forces + n * GROUSER_OUTPUTS, force, golden_surrogate_scale, $surrogate_share,
               GROUSER_OUTPUTS))
      return 0;
  }
  return 1;
}

/* One tick, held to what it promises: mass times acceleration is the force of the recorded row at the guard's weight,
 * the pose follows the velocities, and the memory is the force over the mass. */
static int tick_agrees(enum grouser_source source, const double *command, grouser_vehicle_state *state) {
  static const double terrain[GROUSER_PARAMETERS] = $terrain;
  const double step = 0.01, tolerance =
      1e-9 + 2 * (source == GROUSER_FALLBACK_ALONE ? FALLBACK_TOLERANCE : SURROGATE_TOLERANCE);
  const grouser_vehicle_state before = *state;
  grouser_tick_record record;
  double network[GROUSER_OUTPUTS], block[GROUSER_OUTPUTS];
  if (grouser_vehicle_tick(source, step, command, terrain, NULL, state, &record)) return 0;
  primary.evaluate(primary.self, record.row, network, NULL);
  fallback.evaluate(fallback.self, record.row, block, NULL);
  const double weight = source == GROUSER_FALLBACK_ALONE ? 1.0 : state->guard.fallback_weight;
  double force[GROUSER_OUTPUTS];
  for (int n = 0; n < GROUSER_OUTPUTS; n++) force[n] = weight * block[n] + (1 - weight) * network[n];
  const double rates[3] = {force[0] / vehicle.mass + state->yaw_rate * state->vy,
                           force[1] / vehicle.mass - state->yaw_rate * state->vx, force[2] / vehicle.yaw_inertia};
  const double changes[3] = {state->vx - before.vx, state->vy - before.vy, state->yaw_rate - before.yaw_rate};
  /* Of a tick that was solved in parts, the record holds the last one. */
  for (int n = 0; n < 3 && record.divisions == 1; n++)
    if (!(fabs(changes[n] - step * rates[n]) <= tolerance)) return 0;
  return fabs(state->heading - before.heading - step / 2 * (before.yaw_rate + state->yaw_rate)) <= 1e-12 &&
         fabs(state->ax - force[0] / vehicle.mass) <= 1e-9 && fabs(state->ay - force[1] / vehicle.mass) <= 1e-9;
}

/* A curve from rest on the fallback alone; then, guarded, a drive faster than in training and back. */
static int ticks_agree(void) {
  static const double curve[2] = $curve, fast[2] = $fast, slow[2] = $slow;
  grouser_vehicle_state state = grouser_at_rest();
  for (int n = 0; n < 100; n++)
    if (!tick_agrees(GROUSER_FALLBACK_ALONE, curve, &state)) return 0;
  if (!(state.v_right > 0 && state.v_right < curve[1] && isfinite(state.x + state.y))) return 0;

  int seen = 0;
  state = grouser_at_rest();
  state.vx = state.v_left = state.v_right = $cruise;
  for (int n = 0; n < 300; n++) {
    if (!tick_agrees(GROUSER_GUARDED, n < 60 ? fast : slow, &state)) return 0;
    seen |= state.guard.mode == GROUSER_FALLBACK && state.guard.fallback_weight >= 1.0;
  }
  return seen || !$leaves;
}

int grouser_self_test(void) {
  int failed;
  if (checksum() != UINT64_C($checksum)) return 1;
  failed = check_forces(&primary, golden_surrogate, golden_surrogate_jacobian, golden_surrogate_scale,
                        $surrogate_share, 2);
  if (failed) return failed;
  failed = check_forces(&fallback, golden_fallback, golden_fallback_jacobian, golden_fallback_scale, $fallback_share, 4);
  if (failed) return failed;
  if (!detector_agrees()) return 6;
  if (!guard_agrees()) return 7;
  return ticks_agree() ? 0 : 8;
}
