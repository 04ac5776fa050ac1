/* Every kernel of one level in one file, so that nothing but the level's table has a name outside. */
#define GROUSER_CORE static

#include "load.c"
#include "load_block.c"
#include "soft_cells.c"
#include "soft_cells_single.c"
#include "exact_cells.c"
#include "physics.c"
#include "dense.c"
#include "dense_backward.c"
#include "dense_batch.c"
#include "mlp.c"
#include "track_net.c"
#include "track_net_body.c"
#include "track_net_block.c"
/* The gate asks whether a row is in distribution, and nothing else of the detector. */
#if defined(__GNUC__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#endif
#include "detector.c"
#if defined(__GNUC__)
#pragma GCC diagnostic pop
#endif
#include "gated.c"
#include "fleet_arrays.c"
#include "fleet_block.c"
#include "fleet_deck.c"
#include "fleet_lanes.c"

#include "level.h"

static void physics_evaluate(const void *block, const double *x, double *forces, double *jacobian) {
  grouser_physics_forces((const grouser_physics *)block, x, forces, jacobian);
}

static void physics_evaluate_track(const void *block, const double *x, int side, double *forces, double *jacobian) {
  grouser_physics_track((const grouser_physics *)block, x, (enum grouser_side)side, forces, jacobian);
}

static const char *physics_refuses(const void *block, const double *x) {
  return grouser_physics_refuses((const grouser_physics *)block, x);
}

static void physics_evaluate_body(const void *block, const double *left, const double *right,
                                  enum grouser_slopes_wanted wanted, double *forces,
                                  double slopes[GROUSER_OUTPUTS][3]) {
  grouser_physics_body((const grouser_physics *)block, left, right, forces, wanted ? slopes : NULL);
}

static grouser_kernel physics_kernel(const grouser_physics *block) {
  const grouser_kernel kernel = {
      block, grouser_columns(block->mode), physics_evaluate, physics_refuses, physics_evaluate_track, NULL, NULL,
      physics_evaluate_body, NULL, 0};
  return kernel;
}

static void mlp_evaluate(const void *net, const double *x, double *forces, double *jacobian) {
  grouser_mlp_forces((const grouser_mlp *)net, x, forces, jacobian);
}

static void mlp_evaluate_block(const void *net, const grouser_block_rows *left, const grouser_block_rows *right,
                               const double (*prepared)[GROUSER_BLOCK], enum grouser_slopes_wanted wanted,
                               grouser_block_forces *out) {
  (void)right;
  (void)prepared;
  grouser_mlp_block((const grouser_mlp *)net, left, wanted != GROUSER_NO_SLOPES, out);
}

static void mlp_evaluate_body(const void *net, const double *left, const double *right,
                              enum grouser_slopes_wanted wanted, double *forces, double slopes[GROUSER_OUTPUTS][3]) {
  (void)right;
  grouser_mlp_body((const grouser_mlp *)net, left, forces, wanted ? slopes : NULL);
}

static void mlp_evaluate_rows(const void *net, const double *x, ptrdiff_t rows, double *forces) {
  grouser_mlp_rows((const grouser_mlp *)net, x, rows, forces);
}

static const char *mlp_refuses(const void *self, const double *x) {
  const int inputs = ((const grouser_mlp *)self)->dense.widths[0];
  for (int n = 0; n < inputs; n++)
    if (!isfinite(x[n])) return (inputs == grouser_columns(GROUSER_RIGID) ? RIGID_COLUMNS : SOIL_COLUMNS)[n];
  return NULL;
}

static grouser_kernel mlp_kernel(grouser_mlp *net) {
  grouser_mlp_prepare(net);
  const grouser_kernel kernel = {
      net, net->dense.widths[0], mlp_evaluate, mlp_refuses, NULL, mlp_evaluate_block, mlp_evaluate_rows,
      mlp_evaluate_body, NULL, 0};
  return kernel;
}

static void track_net_evaluate(const void *net, const double *x, double *forces, double *jacobian) {
  grouser_track_net_forces((const grouser_track_net *)net, x, forces, jacobian);
}

static void track_net_evaluate_track(const void *net, const double *x, int side, double *forces, double *jacobian) {
  grouser_track_net_track((const grouser_track_net *)net, x, (enum grouser_side)side, forces, jacobian);
}

static void track_net_prepare_block(const void *net, const grouser_block_rows *left, const grouser_block_rows *right,
                                    double (*prepared)[GROUSER_BLOCK]) {
  grouser_track_net_prepare_block((const grouser_track_net *)net, left, right, prepared);
}

static void track_net_evaluate_block(const void *net, const grouser_block_rows *left, const grouser_block_rows *right,
                                     const double (*prepared)[GROUSER_BLOCK], enum grouser_slopes_wanted wanted,
                                     grouser_block_forces *out) {
  grouser_track_net_block((const grouser_track_net *)net, left, right, prepared, wanted, out);
}

static void track_net_evaluate_body(const void *net, const double *left, const double *right,
                                    enum grouser_slopes_wanted wanted, double *forces,
                                    double slopes[GROUSER_OUTPUTS][3]) {
  grouser_track_net_body((const grouser_track_net *)net, left, right, wanted, forces, slopes);
}

static void track_net_evaluate_rows(const void *self, const double *x, ptrdiff_t rows, double *forces) {
  const grouser_track_net *net = (const grouser_track_net *)self;
  const int columns = grouser_columns(net->block.mode);
  for (ptrdiff_t first = 0; first < rows; first += GROUSER_BLOCK) {
    const int count = rows - first < GROUSER_BLOCK ? (int)(rows - first) : GROUSER_BLOCK;
    grouser_block_rows block;
    grouser_block_forces out;
    double prepared[GROUSER_MAX_PREPARED][GROUSER_BLOCK];
    for (int l = 0; l < GROUSER_BLOCK; l++)
      for (int n = 0; n < columns; n++) block.column[n][l] = x[(first + (l < count ? l : 0)) * columns + n];
    grouser_track_net_prepare_block(net, &block, &block, prepared);
    grouser_track_net_block(net, &block, &block, (const double(*)[GROUSER_BLOCK])prepared, GROUSER_NO_SLOPES, &out);
    for (int l = 0; l < count; l++)
      for (int n = 0; n < GROUSER_OUTPUTS; n++) forces[(first + l) * GROUSER_OUTPUTS + n] = out.force[n][l];
  }
}

static const char *track_net_refuses(const void *net, const double *x) {
  return grouser_physics_refuses(&((const grouser_track_net *)net)->block, x);
}

static grouser_kernel track_net_kernel(grouser_track_net *net) {
  grouser_track_net_prepare(net);
  const grouser_kernel kernel = {net,
                                 grouser_columns(net->block.mode),
                                 track_net_evaluate,
                                 track_net_refuses,
                                 track_net_evaluate_track,
                                 track_net_evaluate_block,
                                 track_net_evaluate_rows,
                                 track_net_evaluate_body,
                                 track_net_prepare_block,
                                 grouser_track_net_prepared_rows(net)};
  return kernel;
}

static void gated_evaluate(const void *gated, const double *x, double *forces, double *jacobian) {
  grouser_gated_forces((const grouser_gated *)gated, x, forces, jacobian);
}

static const char *gated_refuses(const void *self, const double *x) {
  const grouser_kernel *fallback = &((const grouser_gated *)self)->fallback;
  return fallback->refuses(fallback->self, x);
}

static grouser_kernel gated_kernel(const grouser_gated *gated) {
  const grouser_kernel kernel = {gated, gated->fallback.columns, gated_evaluate, gated_refuses, NULL, NULL, NULL, NULL,
                                 NULL,  0};
  return kernel;
}

extern const grouser_level GROUSER_LEVEL_TABLE;
const grouser_level GROUSER_LEVEL_TABLE = {GROUSER_LEVEL_NAME, physics_kernel, mlp_kernel, gated_kernel,
                                                  track_net_kernel, grouser_fleet_advance_lanes};
