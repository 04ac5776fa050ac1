/* The vehicles of a fleet, block by block and deck by deck: compiled once for each vector level. */
#ifndef GROUSER_FLEET_LANES_H
#define GROUSER_FLEET_LANES_H

#include "grouser/fleet.h"

/* A grouser_advance_lanes. */
GROUSER_CORE void grouser_fleet_advance_lanes(const grouser_fleet *fleet, const double *commands, int ticks, int first,
                                              int end);

#endif
