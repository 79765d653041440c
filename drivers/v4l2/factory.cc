#include "drivers/v4l2/discover.h"
#include "drivers/v4l2/driver.h"
#include "drivers/v4l2/v4l2_camera.h"
#include "drivers/v4l2/v4l2_device.h"

namespace lightstage {

Driver<Camera> V4l2Driver() {
  Driver<Camera> driver;
  driver.parse = [](const TomlTable& table) -> DeviceOpener<Camera> {
    V4l2Options options = ParseV4l2Options(table);
    return [options](const DeviceContext& context) {
      return V4l2Camera::Open(V4l2System::Instance(), options, context);
    };
  };
  return driver;
}

Discovery V4l2Discovery() {
  return [] { return DiscoverVideo(V4l2System::Instance()); };
}

}  // namespace lightstage
