// In place of factory.cc where hidapi was missing at build time.
#include "drivers/dlpc350/driver.h"

namespace lightstage {
namespace {

constexpr char kMissing[] =
    "this binary was built without hidapi: install libhidapi-dev and build again";

absl::Status NotBuilt() {
  return Error(absl::StatusCode::kUnimplemented, "DRIVER_NOT_BUILT", kMissing);
}

}  // namespace

Driver<Projector> Dlpc350Driver(Driver<Projector>) {
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

Discovery Dlpc350Discovery() {
  return []() -> absl::StatusOr<std::vector<Discovered>> { return NotBuilt(); };
}

}  // namespace lightstage
