// In place of factory.cc where SDL2, Xlib or RandR was missing at build time.
#include "drivers/display/driver.h"

namespace lightstage {
namespace {

constexpr char kMissing[] =
    "this binary was built without SDL2: install libsdl2-dev, libx11-dev and libxrandr-dev and "
    "build again";

absl::Status NotBuilt() {
  return Error(absl::StatusCode::kUnimplemented, "DRIVER_NOT_BUILT", kMissing);
}

}  // namespace

Driver<Projector> DisplayDriver() {
  Driver<Projector> driver;
  driver.parse = [](const TomlTable& table) -> DeviceOpener<Projector> {
    table.Ignore();
    table.ErrorAt("driver", kMissing);
    return [](const DeviceContext&) -> absl::StatusOr<std::unique_ptr<Projector>> {
      return NotBuilt();
    };
  };
  return driver;
}

Discovery DisplayDiscovery() {
  return []() -> absl::StatusOr<std::vector<Discovered>> { return NotBuilt(); };
}

}  // namespace lightstage
