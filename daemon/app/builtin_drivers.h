#pragma once

#include "drivers/api/registry.h"

namespace lightstage {

// Every driver of this binary, by name: the one place to add one.
void RegisterBuiltinDrivers(DriverRegistry& registry);

}  // namespace lightstage
