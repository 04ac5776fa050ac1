/* ---- surrogate and fallback as kernels ---- */
static void evaluate_surrogate(const void *self, const double *x, double *forces, double *jacobian) {
  $forces((const $kind *)self, x, forces, jacobian);
}

static const char *surrogate_refuses(const void *self, const double *x) {
  (void)self;
  return grouser_physics_refuses(&physics, x);
}

static void evaluate_fallback(const void *self, const double *x, double *forces, double *jacobian) {
  grouser_physics_forces((const grouser_physics *)self, x, forces, jacobian);
}

static const char *fallback_refuses(const void *self, const double *x) {
  return grouser_physics_refuses((const grouser_physics *)self, x);
}

static const grouser_kernel primary = $primary;
static const grouser_kernel fallback = $fallback;
static const grouser_guard guard = $guard;
static const grouser_vehicle vehicle = $vehicle;
/* Residual, in m/s and rad/s, at which a tick counts as solved: what float32 and what float64 forces resolve. */
static const double SURROGATE_TOLERANCE = $surrogate_tolerance, FALLBACK_TOLERANCE = $fallback_tolerance;

