/* How the vehicles of a fleet are read and written. */
#ifndef GROUSER_FLEET_LANES_H
#define GROUSER_FLEET_LANES_H

#include "grouser/fleet.h"

void grouser_fleet_load(const grouser_fleet *fleet, int vehicle, grouser_vehicle_state *state);
void grouser_fleet_store(const grouser_fleet *fleet, int vehicle, const grouser_vehicle_state *state,
                         const grouser_tick_record *record);

#endif
