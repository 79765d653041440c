#include "drivers/aravis/aravis_camera.h"
#include "drivers/aravis/driver.h"

namespace lightstage {

Driver<Camera> AravisDriver() {
  Driver<Camera> driver;
  driver.parse = [](const TomlTable& table) -> DeviceOpener<Camera> {
    AravisOptions options = ParseAravisOptions(table);
    return [options](const DeviceContext& context) { return AravisCamera::Open(options, context); };
  };
  return driver;
}

Discovery AravisDiscovery() {
  return [] { return DiscoverAravis(); };
}

}  // namespace lightstage
