// The drivers that this binary has. Filled by name in daemon/app/builtin_drivers.cc, read by daemon/config.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "drivers/api/axis.h"
#include "drivers/api/camera.h"
#include "drivers/api/lamps.h"
#include "drivers/api/projector.h"

namespace lightstage {

// A device that was found on a bus.
struct Discovered {
  std::string what;  // one line for people: maker, model, serial number, where it is
  std::string
      toml;  // lines of a rig file that would open it; what only the lab knows is left as a comment
};

// Looks for devices without changing them; at most a few seconds. What cannot be looked at is an error that says why.
using Discovery = absl::AnyInvocable<absl::StatusOr<std::vector<Discovered>>() const>;

struct DriverRegistry {
  std::map<std::string, Driver<Camera>> cameras;
  std::map<std::string, Driver<Axis>> axes;
  std::map<std::string, Driver<Lamps>> lamps;
  std::map<std::string, Driver<Projector>> projectors;
  std::map<std::string, Discovery> discoveries;  // by driver
  // Top-level tables of the rig file that belong to a driver family, e.g. [simulation]; parsed before any device table, and
  // only if present.
  std::map<std::string, absl::AnyInvocable<void(const TomlTable&) const>> tables;
};

}  // namespace lightstage
