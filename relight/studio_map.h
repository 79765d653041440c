// A procedural environment map for demonstrations and tests: a photographer's studio.
#pragma once

#include "optics/image.h"

namespace lightstage::relight {

// RGB radiance in the layout of optics/environment_map.h, width × width/2: a dim room, a large cool window with bars (azimuths 20° to
// 75°), a small warm lamp (at −65°, over 300 times brighter than the room), and a blue strip (at 180°).
Image StudioMap(int width);

}  // namespace lightstage::relight
