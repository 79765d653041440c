// The driver "aravis": GigE Vision and USB3 Vision cameras through libaravis. Options in README.md.
#pragma once

#include "drivers/api/camera.h"

namespace lightstage {

Driver<Camera> AravisDriver();

}  // namespace lightstage
