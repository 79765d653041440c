// In place of factory.cc where libusb was missing at build time.
#include "drivers/dmx/driver.h"

namespace lightstage {
namespace {

constexpr char kMissing[] =
    "this binary was built without libusb: install libusb-1.0-0-dev and build again";

absl::Status NotBuilt() {
  return Error(absl::StatusCode::kUnimplemented, "DRIVER_NOT_BUILT", kMissing);
}

}  // namespace

Driver<Lamps> DmxDriver() {
  Driver<Lamps> driver;
  driver.parse = [](const TomlTable& table) -> DeviceOpener<Lamps> {
    table.Ignore();
    table.ErrorAt("driver", kMissing);
    return
        [](const DeviceContext&) -> absl::StatusOr<std::unique_ptr<Lamps>> { return NotBuilt(); };
  };
  return driver;
}

Discovery DmxDiscovery() {
  return []() -> absl::StatusOr<std::vector<Discovered>> { return NotBuilt(); };
}

}  // namespace lightstage
