// In place of factory.cc where libmodbus was missing at build time.
#include "drivers/modbus/driver.h"

namespace lightstage {
namespace {

constexpr char kMissing[] =
    "this binary was built without libmodbus: install libmodbus-dev and build again";

template <class Device>
Driver<Device> Missing() {
  Driver<Device> driver;
  driver.parse = [](const TomlTable& table) -> DeviceOpener<Device> {
    table.Ignore();
    table.ErrorAt("driver", kMissing);
    return [](const DeviceContext&) -> absl::StatusOr<std::unique_ptr<Device>> {
      return Error(absl::StatusCode::kUnimplemented, "DRIVER_NOT_BUILT", kMissing);
    };
  };
  return driver;
}

}  // namespace

Driver<Axis> ModbusAxisDriver() { return Missing<Axis>(); }
Driver<Lamps> ModbusLampsDriver() { return Missing<Lamps>(); }

Discovery ModbusDiscovery() {
  return []() -> absl::StatusOr<std::vector<Discovered>> {
    return Error(absl::StatusCode::kUnimplemented, "DRIVER_NOT_BUILT", kMissing);
  };
}

}  // namespace lightstage
