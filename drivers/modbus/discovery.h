// Where a Modbus line may be. Nothing is spoken to.
#pragma once

#include <string>
#include <vector>

#include "drivers/api/registry.h"

namespace lightstage {

// The serial ports of `directory` (/dev/serial/by-id), and last a word on what cannot be found.
absl::StatusOr<std::vector<Discovered>> DiscoverModbus(const std::string& directory);

}  // namespace lightstage
