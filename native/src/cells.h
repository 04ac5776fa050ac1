/* The cells under the tracks, and the models of how far the ground is sheared there.
 *
 * Cells lie in rows across a track; the places of the rows along it are its stations. A vector holds stations, whatever
 * elements they belong to, and what a cell shares with its row or its column is computed once for all of them. Each
 * track is mirrored to the left, and lever arms are taken from its middle. */
#ifndef GROUSER_CELLS_H
#define GROUSER_CELLS_H

#include "doubles.h"
#include "grouser/physics.h"

/* Stations are taken eight at a time, so that sums have one order at every vector level, and so many times eight in a
 * run; columns in strips, short enough for the stack. */
enum { GROUSER_STATIONS = 8, GROUSER_STRIP = 64, GROUSER_RUN = 16 };

/* Where the stations of either track are. */
typedef struct {
  int count;                   /* of stations */
  double along;                /* stations an element */
  double per_along, per_cells; /* one over it, and over the cells of an element */
  double step;                 /* m, between those of an element */
  double spacing;              /* m, between elements */
  double half;                 /* m, of an element's length */
  double middle;               /* number of the element in the middle: half a number if there are two */
  double center;               /* m, of the contact, from the CG */
  double reach;                /* 1 where shear is counted from the middle of the contact, 0 from the element's */
  double mean_share;           /* 1/elements */
  double lean, lean_by_ax;     /* 1/m, an element's share of the load by its place along the contact, at ax = 0 */
} grouser_layout;

/* The motion of a track, and the ground under it. */
typedef struct {
  double slip;               /* m/s, along the track at its middle */
  double vy, yaw_rate;       /* m/s, of the CG; rad/s */
  double belt;               /* m/s */
  double modulus;            /* m, K */
  double direction;          /* s */
  double direction_slope;    /* ds/dVt */
  double stretch;            /* s/m, contact time over K where shear is counted from */
  double stretch_slope;      /* s/m^2, what it loses ahead of there */
  double slope_by_belt;      /* by Vt at the distance travelled: of what it loses, through s; */
  double fall_by_belt;       /* s/m, of any contact time, its share, through the belt's speed */
  double load, load_by_ay;   /* N; N s^2/m */
  double lean, lean_by_ax;   /* 1/m, an element's share of the load by its place along the contact */
  double per_total;          /* over the sum of the shares that are not negative */
  double total_by_ax;        /* of that sum */
  double cohesion;           /* N, of a cell */
  double friction;           /* of a cell, by its element's load */
  double strength;           /* N, of a cell by its element's share of the track's load */
  double full_contacts;      /* the track's load over that of an element below which cohesion fades */
  double per_full_contact;   /* 1/N */
  int cohesive, fading;      /* whether there is cohesion on such ground, and fades under any element */
} grouser_track;

/* A strip of columns: slip along a track, and arms from its middle. */
typedef struct {
  int count;
  double arm[GROUSER_STRIP], arm_square[GROUSER_STRIP];
  double slip[GROUSER_STRIP], slip_square[GROUSER_STRIP], slip_moment[GROUSER_STRIP]; /* v, v^2, v y */
} grouser_strip;

/* By vx, vy, yaw rate, belt speed and K. */
enum { GROUSER_BY_VX, GROUSER_BY_VY, GROUSER_BY_YAW_RATE, GROUSER_BODY_SLOPES, GROUSER_BY_BELT = GROUSER_BODY_SLOPES,
       GROUSER_BY_MODULUS, GROUSER_SLOPES };

/* Unit forces weighted by what the strength hangs on: share of the load, and its slope by ax; share of cohesion that is
 * left; both shares where it fades. The first two are all that there are on firm ground. */
enum { GROUSER_OF_SHARE, GROUSER_OF_SHARE_SLOPE, GROUSER_OF_COHESION, GROUSER_OF_FADING_SHARE,
       GROUSER_OF_FADING_SHARE_SLOPE, GROUSER_WEIGHTED, GROUSER_RIGID_WEIGHTED = GROUSER_OF_COHESION };

/* Whether a slope is the same as another one across the diagonal of a symmetric matrix. */
GROUSER_INLINE int grouser_mirrored(int symmetric, int by, int n) {
  return symmetric && by < GROUSER_BODY_SLOPES && n < by;
}

/* Forces alone; with their slopes by the body's motion, which is what Newton asks for; with all slopes. */
enum grouser_wanted { GROUSER_FORCES_WANTED, GROUSER_BODY_SLOPES_WANTED, GROUSER_ALL_SLOPES_WANTED };

/* Stations of both tracks at once: those of the left one, then of the right one. */
enum { GROUSER_BOTH = 2 * GROUSER_STATIONS };

/* Eight stations, found before their cells are summed, so that no sum has to wait for them. */
typedef struct {
  GROUSER_ALIGNED double x[GROUSER_BOTH];        /* m, from the CG */
  GROUSER_ALIGNED double across[GROUSER_BOTH];   /* m/s, slip velocity across the track */
  GROUSER_ALIGNED double stretch[GROUSER_BOTH];  /* s/m, time since the ground was entered over K */
  GROUSER_ALIGNED double strength[GROUSER_BOTH]; /* N, of a cell */
  GROUSER_ALIGNED double stretch_by_belt[GROUSER_BOTH], stretch_by_modulus[GROUSER_BOTH];
  GROUSER_ALIGNED double share[GROUSER_BOTH], share_by_ax[GROUSER_BOTH]; /* of the track's load, under the element */
  GROUSER_ALIGNED double cohesion[GROUSER_BOTH]; /* share of it that is left */
  GROUSER_ALIGNED double fading[GROUSER_BOTH];   /* 1 where some is gone, or 0 */
} grouser_stations;

/* Sums over a run of stations and a strip of columns, in lanes: of forces against the slip along, across, and of their
 * moment about the track's middle at the CG; their slopes at unchanged load. */
typedef struct {
  GROUSER_ALIGNED double force[GROUSER_OUTPUTS][GROUSER_STATIONS];
  GROUSER_ALIGNED double slope[GROUSER_SLOPES][GROUSER_OUTPUTS][GROUSER_STATIONS];
  GROUSER_ALIGNED double weighted[GROUSER_WEIGHTED][GROUSER_OUTPUTS][GROUSER_STATIONS];
} grouser_patch_sums;

/* A run of stations and a strip of columns of one or of both tracks, each with its own motion, columns and sums. */
typedef struct {
  int tracks, count; /* of grouser_stations */
  const grouser_track *track;
  const grouser_strip *strip;
  const grouser_stations *at;
} grouser_patch;

/* Sum the cells of a patch. Soft: the slip velocity of this moment over the contact time; its matrix is symmetric, and
 * what would stand below the diagonal is left out. Exact: the path of the belt point over the ground, with the
 * vehicle's rotation on the way. */
GROUSER_CORE void grouser_soft_cells(const grouser_patch *patch, enum grouser_wanted wanted, grouser_patch_sums *sums);
GROUSER_CORE void grouser_exact_cells(const grouser_patch *patch, enum grouser_wanted wanted,
                                      grouser_patch_sums *sums);

/* Soft in float32, of both tracks. Slip and places are found in float64, so that what is rounded is of the size of a
 * cell's share. */
GROUSER_CORE void grouser_single_cells(const grouser_patch *patch, enum grouser_wanted wanted,
                                       grouser_patch_sums *sums);

#endif
