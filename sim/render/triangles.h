// A mesh as Embree takes it.
#pragma once

#include <embree3/rtcore.h>

#include "sim/render/scene.h"

namespace lightstage::sim {

// Not committed, and the caller's to release. Errors stay with the device.
RTCGeometry MakeTriangles(RTCDevice device, const Mesh& mesh);

}  // namespace lightstage::sim
