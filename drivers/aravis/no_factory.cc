// In place of factory.cc where libaravis was missing at build time.
#include "drivers/aravis/driver.h"

namespace lightstage {
namespace {

constexpr char kMissing[] =
    "this binary was built without libaravis: install libaravis-dev and libusb-1.0-0-dev and build "
    "again";

}  // namespace

Driver<Camera> AravisDriver() {
  Driver<Camera> driver;
  driver.parse = [](const TomlTable& table) -> DeviceOpener<Camera> {
    table.Ignore();
    table.ErrorAt("driver", kMissing);
    return [](const DeviceContext&) -> absl::StatusOr<std::unique_ptr<Camera>> {
      return Error(absl::StatusCode::kUnimplemented, "DRIVER_NOT_BUILT", kMissing);
    };
  };
  return driver;
}

Discovery AravisDiscovery() {
  return []() -> absl::StatusOr<std::vector<Discovered>> {
    return Error(absl::StatusCode::kUnimplemented, "DRIVER_NOT_BUILT", kMissing);
  };
}

}  // namespace lightstage
