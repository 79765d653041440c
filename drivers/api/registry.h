// The drivers that this binary has. Filled by name in daemon/app/builtin_drivers.cc, read by daemon/config.
#pragma once

#include <map>
#include <string>

#include "drivers/api/axis.h"
#include "drivers/api/camera.h"
#include "drivers/api/lamps.h"
#include "drivers/api/projector.h"

namespace lightstage {

struct DriverRegistry {
  std::map<std::string, Driver<Camera>> cameras;
  std::map<std::string, Driver<Axis>> axes;
  std::map<std::string, Driver<Lamps>> lamps;
  std::map<std::string, Driver<Projector>> projectors;
  // Top-level tables of the rig file that belong to a driver family, e.g. [simulation]; parsed before any device table, and
  // only if present.
  std::map<std::string, absl::AnyInvocable<void(const TomlTable&) const>> tables;
};

}  // namespace lightstage
