// The rig of the simulated rig's tests.
#pragma once

#include "optics/rig_geometry.h"

namespace lightstage::sim {

// Three lamps, a projector above and a camera in front.
inline RigGeometry Rig() {
  RigGeometry rig;
  rig.brace = {Meters(1), Meters(0.02), {}};
  for (double tilt : {20.0, 40.0, 60.0}) rig.brace.lamps.push_back({Degrees(0), Degrees(tilt)});
  rig.projector = {true, Meters(1.5), Degrees(0), Degrees(20), 64, 48};
  rig.camera = {Vec3(0, -1.1, 0.55), Vec3(0, 0, 0.07), Degrees(20)};
  return rig;
}

}  // namespace lightstage::sim
