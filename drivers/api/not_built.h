// What takes a driver's place where its library was missing when this binary was built: for no_factory.cc.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "base/status.h"
#include "drivers/api/registry.h"

namespace lightstage {

// UNIMPLEMENTED / DRIVER_NOT_BUILT. `missing` says what is missing and which packages to install.
inline absl::Status NotBuilt(const std::string& missing) {
  return Error(absl::StatusCode::kUnimplemented, "DRIVER_NOT_BUILT", missing);
}

// A rig file that names it is refused with `missing` at "driver".
template <class Device>
Driver<Device> NotBuiltDriver(const std::string& missing) {
  Driver<Device> driver;
  driver.parse = [missing](const TomlTable& table) -> DeviceOpener<Device> {
    table.Ignore();
    table.ErrorAt("driver", missing);
    return [missing](const DeviceContext&) -> absl::StatusOr<std::unique_ptr<Device>> {
      return NotBuilt(missing);
    };
  };
  return driver;
}

inline Discovery NotBuiltDiscovery(const std::string& missing) {
  return [missing]() -> absl::StatusOr<std::vector<Discovered>> { return NotBuilt(missing); };
}

}  // namespace lightstage
