#include "fleet_block.h"

#include <float.h>
#include <math.h>
#include <stddef.h>
#include <string.h>

#include "body.h"
#include "lane_loop.h"
#include "motion.h"

static void turn_lanes(const double *heading, double *cosine, double *sine) {
  int wide = 0;
  GROUSER_LANE_LOOP
  for (int l = 0; l < GROUSER_BLOCK; l++) {
    const grouser_turn turn = grouser_narrow_turn(heading[l]);
    cosine[l] = turn.cosine;
    sine[l] = turn.sine;
    wide |= !(fabs(heading[l]) <= GROUSER_WIDEST_TURN);
  }
  for (int l = 0; wide && l < GROUSER_BLOCK; l++) {
    const grouser_turn turn = grouser_turn_of(heading[l]);
    cosine[l] = turn.cosine;
    sine[l] = turn.sine;
  }
}

static int ground_varies(const grouser_ground *ground) {
  return ground->field || ground->slope_x != 0.0 || ground->slope_y != 0.0;
}

/* Ground of one lane; 0 where there is none. */
static int stand(grouser_fleet_block *b, const grouser_fleet *fleet, int l) {
  const int parameters = fleet->plant->kernel->columns - GROUSER_TERRAIN;
  grouser_footing footing;
  memset(&footing, 0, sizeof footing);
  if (!grouser_sample_ground(&fleet->grounds[b->vehicle[l]], &fleet->plant->sampling, b->state[GROUSER_STATE_X][l],
                             b->state[GROUSER_STATE_Y][l], b->cosine[l], b->sine[l], &footing))
    return 0;
  for (int p = 0; p < parameters; p++) {
    b->theta[0][p][l] = footing.theta[0][p];
    b->theta[1][p][l] = footing.theta[1][p];
  }
  b->pull[0][l] = footing.pull_x;
  b->pull[1][l] = footing.pull_y;
  b->load_ratio[l] = footing.load_ratio;
  return 1;
}

void grouser_block_ready(grouser_fleet_block *b, const grouser_fleet *fleet) {
  turn_lanes(b->state[GROUSER_STATE_HEADING], b->cosine, b->sine);
  for (int l = 0; l < b->count; l++) {
    if (ground_varies(&fleet->grounds[b->vehicle[l]]))
      b->ground_varies = 1;
    else
      (void)stand(b, fleet, l); /* The tick finds out what is not finite. */
  }
}

/* Belts of one side at the tick's end and in its middle. */
static void move_belts(const grouser_fleet_block *b, const grouser_fleet *fleet, int side, double *end,
                       double *middle) {
  const double step = fleet->plant->step, half = step / 2;
  const double *speed = b->state[GROUSER_STATE_V_LEFT + side], *command = b->command[side];
  int64_t bends = 0;
  GROUSER_LANE_LOOP
  for (int l = 0; l < GROUSER_BLOCK; l++) {
    const double gap = command[l] - speed[l], acceleration = b->belt_acceleration[l];
    const double ramp_time = grouser_ramp_time(gap, b->belt_time_constant[l], acceleration);
    const double end_on_ramp = grouser_belt_on_ramp(speed[l], gap, acceleration, step);
    const double middle_on_ramp = grouser_belt_on_ramp(speed[l], gap, acceleration, half);
    const double end_closing = command[l] - gap * b->decay[l], middle_closing = command[l] - gap * b->half_decay[l];
    end[l] = ramp_time >= step ? end_on_ramp : end_closing;
    middle[l] = ramp_time >= half ? middle_on_ramp : middle_closing;
    bends |= (ramp_time > 0) & (ramp_time < step);
  }
  for (int l = 0; bends && l < GROUSER_BLOCK; l++) {
    const grouser_traits *traits = &fleet->traits[b->vehicle[l]];
    end[l] = grouser_belt_after(traits, speed[l], command[l], step, traits->decay);
    middle[l] = grouser_belt_after(traits, speed[l], command[l], half, traits->half_decay);
  }
}

static void find_lost(grouser_fleet_block *b) {
  int64_t lost = 0;
  GROUSER_LANE_LOOP
  for (int l = 0; l < GROUSER_BLOCK; l++) {
    double sum = 0;
    for (int row = 0; row < GROUSER_STATE_ROWS; row++) sum += b->state[row][l];
    const int64_t finite =
        (fabs(sum) <= DBL_MAX) & (fabs(b->command[0][l]) <= DBL_MAX) & (fabs(b->command[1][l]) <= DBL_MAX);
    b->solved[l] = 0;
    b->ticking[l] = finite;
    lost |= !finite;
  }
  GROUSER_LANE_LOOP
  for (int l = 0; l < GROUSER_BLOCK; l++) {
    b->ticking[l] &= b->status[l] == GROUSER_SOLVED;
    if (lost && b->status[l] == GROUSER_SOLVED && !b->ticking[l]) b->status[l] = GROUSER_DIVERGED;
  }
}

static void watch(grouser_fleet_block *b, const grouser_plant *plant, int l) {
  const int columns = plant->kernel->columns;
  double level[GROUSER_MAX_COLUMNS];
  for (int n = 0; n < columns; n++) level[n] = b->row[n][l];
  grouser_to_level(level, columns, b->load_ratio[l]);
  b->detection[l] = grouser_detect(&plant->guard->detector, level);
  b->next_guard[l] = grouser_guard_advance(&plant->guard->policy, &b->guard[l], &b->detection[l], plant->step);
}

void grouser_block_begin(grouser_fleet_block *b, const grouser_fleet *fleet) {
  const grouser_plant *plant = fleet->plant;
  const int parameters = plant->kernel->columns - GROUSER_TERRAIN, euler = plant->integrator == GROUSER_EULER;
  const double span = plant->vehicle.tread * plant->step;
  find_lost(b);
  for (int l = 0; b->ground_varies && l < GROUSER_BLOCK; l++)
    if (b->ticking[l] && !stand(b, fleet, l)) {
      b->status[l] = GROUSER_OFF_MAP;
      b->ticking[l] = 0;
    }
  memcpy(b->row[GROUSER_VX], b->state[GROUSER_STATE_VX], sizeof b->row[0]);
  memcpy(b->row[GROUSER_VY], b->state[GROUSER_STATE_VY], sizeof b->row[0]);
  memcpy(b->row[GROUSER_YAW_RATE], b->state[GROUSER_STATE_YAW_RATE], sizeof b->row[0]);
  memcpy(b->row[GROUSER_AX], b->state[GROUSER_STATE_AX], sizeof b->row[0]);
  memcpy(b->row[GROUSER_AY], b->state[GROUSER_STATE_AY], sizeof b->row[0]);
  for (int side = 0; side < 2; side++) {
    double *taken = b->row[GROUSER_V_LEFT + side];
    move_belts(b, fleet, side, b->belts[side], taken);
    if (euler) memcpy(taken, b->state[GROUSER_STATE_V_LEFT + side], sizeof b->row[0]);
  }
  memcpy(b->row[GROUSER_TERRAIN], b->theta[0], sizeof b->row[0] * (size_t)parameters);
  /* As grouser_tick_begin. */
  GROUSER_LANE_LOOP
  for (int l = 0; l < GROUSER_BLOCK; l++)
    b->yaw_acceleration[l] =
        ((b->belts[1][l] - b->row[GROUSER_V_RIGHT][l]) - (b->belts[0][l] - b->row[GROUSER_V_LEFT][l])) / span;
  for (int l = 0; plant->guard && l < GROUSER_BLOCK; l++)
    if (b->ticking[l]) watch(b, plant, l);
}

void grouser_block_solve(grouser_fleet_block *b, const grouser_fleet *fleet, int l) {
  const grouser_plant *plant = fleet->plant;
  grouser_tick_start start;
  grouser_vehicle_state state = grouser_vehicle_at_rest();
  grouser_body_step step;
  memset(&start, 0, sizeof start);
  start.traits = &fleet->traits[b->vehicle[l]];
  start.yaw_acceleration = b->yaw_acceleration[l];
  start.guard = b->next_guard[l];
  start.detection = b->detection[l];
  state.guard = b->guard[l];
  for (int n = 0; n < plant->kernel->columns; n++) start.row[n] = b->row[n][l];
  for (int p = 0; p < plant->kernel->columns - GROUSER_TERRAIN; p++) {
    start.footing.theta[0][p] = b->theta[0][p][l];
    start.footing.theta[1][p] = b->theta[1][p][l];
  }
  start.footing.split = plant->sampling.tracks;
  start.footing.pull_x = b->pull[0][l];
  start.footing.pull_y = b->pull[1][l];
  start.footing.load_ratio = b->load_ratio[l];
  b->status[l] = grouser_tick_solve(plant, &start, &state, &step);
  if (b->status[l] != GROUSER_SOLVED) return;
  b->next_guard[l] = start.guard;
  b->detection[l] = start.detection;
  b->solved[l] = 1;
  b->solution.body[0][l] = step.body.vx;
  b->solution.body[1][l] = step.body.vy;
  b->solution.body[2][l] = step.body.yaw_rate;
  for (int n = 0; n < 3; n++) {
    b->solution.received[n][l] = step.row[n];
    b->solution.force[n][l] = step.force[n];
  }
  b->solution.iterations[l] = step.iterations;
  b->solution.divisions[l] = step.divisions;
}

/* Takes `from` where the tick stands. */
static void keep_lanes(const int64_t *stands, const double *from, double *to) {
  GROUSER_LANE_LOOP
  for (int l = 0; l < GROUSER_BLOCK; l++) to[l] = stands[l] ? from[l] : to[l];
}

static void record_lanes(grouser_fleet_block *b, const grouser_plant *plant, const int64_t *stands) {
  const grouser_block_solution *s = &b->solution;
  grouser_block_record *record = &b->record;
  for (int n = 0; n < plant->kernel->columns; n++)
    keep_lanes(stands, n < GROUSER_AX ? s->received[n] : b->row[n], record->row[n]);
  for (int n = 0; n < GROUSER_OUTPUTS; n++) keep_lanes(stands, s->force[n], record->force[n]);
  keep_lanes(stands, s->iterations, record->iterations);
  keep_lanes(stands, s->divisions, record->divisions);
  GROUSER_LANE_LOOP
  for (int l = 0; l < GROUSER_BLOCK; l++) record->any[l] |= stands[l] != 0;
  for (int l = 0; plant->guard && l < GROUSER_BLOCK; l++)
    if (stands[l]) {
      record->detection[l] = b->detection[l];
      b->guard[l] = b->next_guard[l];
    }
}

void grouser_block_finish(grouser_fleet_block *b, const grouser_plant *plant) {
  const double half = plant->step / 2, mass = plant->vehicle.mass;
  const grouser_block_solution *s = &b->solution;
  double end[GROUSER_STATE_ROWS][GROUSER_BLOCK], cosine[GROUSER_BLOCK], sine[GROUSER_BLOCK];
  int64_t stands[GROUSER_BLOCK], lost = 0;
  GROUSER_LANE_LOOP
  for (int l = 0; l < GROUSER_BLOCK; l++)
    end[GROUSER_STATE_HEADING][l] =
        b->state[GROUSER_STATE_HEADING][l] + half * (b->state[GROUSER_STATE_YAW_RATE][l] + s->body[2][l]);
  turn_lanes(end[GROUSER_STATE_HEADING], cosine, sine);
  GROUSER_LANE_LOOP
  for (int l = 0; l < GROUSER_BLOCK; l++) {
    const double c0 = b->cosine[l], s0 = b->sine[l], c1 = cosine[l], s1 = sine[l];
    const double vx = b->state[GROUSER_STATE_VX][l], vy = b->state[GROUSER_STATE_VY][l];
    end[GROUSER_STATE_X][l] =
        b->state[GROUSER_STATE_X][l] + half * (c0 * vx - s0 * vy + c1 * s->body[0][l] - s1 * s->body[1][l]);
    end[GROUSER_STATE_Y][l] =
        b->state[GROUSER_STATE_Y][l] + half * (s0 * vx + c0 * vy + s1 * s->body[0][l] + c1 * s->body[1][l]);
    end[GROUSER_STATE_VX][l] = s->body[0][l];
    end[GROUSER_STATE_VY][l] = s->body[1][l];
    end[GROUSER_STATE_YAW_RATE][l] = s->body[2][l];
    end[GROUSER_STATE_V_LEFT][l] = b->belts[0][l];
    end[GROUSER_STATE_V_RIGHT][l] = b->belts[1][l];
    end[GROUSER_STATE_AX][l] = s->force[0][l] / mass;
    end[GROUSER_STATE_AY][l] = s->force[1][l] / mass;
    end[GROUSER_STATE_TIME][l] = b->state[GROUSER_STATE_TIME][l] + plant->step;
  }
  GROUSER_LANE_LOOP
  for (int l = 0; l < GROUSER_BLOCK; l++) {
    double sum = 0;
    for (int row = 0; row < GROUSER_STATE_ROWS; row++) sum += end[row][l];
    stands[l] = b->solved[l] & (fabs(sum) <= DBL_MAX);
    lost |= stands[l] ^ b->solved[l];
  }
  for (int l = 0; lost && l < GROUSER_BLOCK; l++)
    if (b->solved[l] && !stands[l]) b->status[l] = GROUSER_DIVERGED;
  for (int row = 0; row < GROUSER_STATE_ROWS; row++) keep_lanes(stands, end[row], b->state[row]);
  keep_lanes(stands, cosine, b->cosine);
  keep_lanes(stands, sine, b->sine);
  record_lanes(b, plant, stands);
}
