// Cameras of the kernel (command_bench).
#pragma once

#include <string>

#include "bench/stage.h"

namespace lightstage::bench {

// `node`: /dev/video0 …, a camera with 8-bit grey in 640x360, such as vivid.
absl::Status MeasureV4l2(Stage& stage, const std::string& node);

}  // namespace lightstage::bench
