#include "drivers/dmx/discovery.h"
#include "drivers/dmx/dmx_lamps.h"
#include "drivers/dmx/driver.h"
#include "drivers/dmx/libusb_bus.h"

namespace lightstage {

Driver<Lamps> DmxDriver() {
  Driver<Lamps> driver;
  driver.parse = [](const TomlTable& table) -> DeviceOpener<Lamps> {
    dmx::DmxOptions options = dmx::ParseDmxOptions(table);
    return [options](const DeviceContext& context) {
      return dmx::OpenDmxLamps(options, context, dmx::MakeLibusbBus());
    };
  };
  return driver;
}

Discovery DmxDiscovery() {
  return []() -> absl::StatusOr<std::vector<Discovered>> {
    ASSIGN_OR_RETURN(std::vector<dmx::UsbIdentity> devices, dmx::MakeLibusbBus()->List());
    return dmx::Describe(devices);
  };
}

}  // namespace lightstage
