// lightstaged --discover
#pragma once

#include <ostream>

#include "drivers/api/registry.h"

namespace lightstage {

// Writes what every driver finds on its bus, with the lines of a rig file that would open it; a bus that cannot be looked at says why.
void Discover(const DriverRegistry& drivers, std::ostream& out);

}  // namespace lightstage
