// The driver "v4l2": cameras of the Linux kernel (USB webcams, frame grabbers, CSI sensors) through /dev/video*. Options in
// README.md.
#pragma once

#include "drivers/api/camera.h"
#include "drivers/api/registry.h"

namespace lightstage {

Driver<Camera> V4l2Driver();

// Every /dev/video* that captures: what it is, what it offers, and lines for a rig file.
Discovery V4l2Discovery();

}  // namespace lightstage
