#pragma once

#include <memory>

#include "drivers/api/registry.h"
#include "sim/rig/drivers.h"

namespace lightstage {

// Every driver of this binary, by name: the one place to add one. What the rig file says of the simulation can be had from the result.
std::shared_ptr<sim::Simulation> RegisterBuiltinDrivers(DriverRegistry& registry);

}  // namespace lightstage
