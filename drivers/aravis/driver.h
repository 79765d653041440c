// The driver "aravis": GigE Vision and USB3 Vision cameras through libaravis. Options in README.md.
#pragma once

#include "drivers/api/registry.h"

namespace lightstage {

Driver<Camera> AravisDriver();

// Asks all network interfaces and the USB for cameras: about a second.
Discovery AravisDiscovery();

}  // namespace lightstage
