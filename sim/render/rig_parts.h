// The rig's own parts that stand in the light: brace, gantry, bodies of camera and projector. All black.
//
// Camera and object ride together, so the camera's body is part of the scene; brace and gantry turn against them, and are asked for at
// every pose. They block light on its way from a lamp or the projector to where it is scattered first, and to the camera; light that goes
// from surface to surface stays within the brace and does not meet them.
#pragma once

#include <embree3/rtcore.h>

#include <memory>
#include <vector>

#include "optics/rig_geometry.h"
#include "sim/render/scene.h"

namespace lightstage::sim {

// Sizes in metres; 0: there is none.
struct PartOptions {
  // Edge of a square box behind the camera's pinhole, twice as long.
  double camera_body = 0;
  // Diameter of the bar behind the lamps, from each to the next, and of a housing behind each.
  double brace_bar = 0;
  // Width of a box behind the projector's lens; half as high, as long as wide.
  double projector_body = 0;
  // Diameter of the two bars from the turning axis to the projector, outside of the camera's way.
  double gantry_bar = 0;
};

// In the object frame, to be put into the scene; nothing if the options have none.
std::vector<Mesh> CameraBody(const CameraGeometry& camera, const PartOptions& options);

class RigParts {
 public:
  RigParts(const RigGeometry& geometry, const PartOptions& options);
  RigParts(const RigParts&) = delete;
  RigParts& operator=(const RigParts&) = delete;
  ~RigParts();

  // Whether there is anything, and whether it matters where the gantry is.
  bool empty() const { return brace_.empty() && !gantry(); }
  bool gantry() const { return options_.projector_body > 0 || options_.gantry_bar > 0; }

  struct Release {
    void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
  };
  // In the object frame at this pose; null if empty(). Any thread.
  std::unique_ptr<RTCSceneTy, Release> At(const Pose& pose) const;

 private:
  const RigGeometry geometry_;
  const PartOptions options_;
  std::vector<Mesh> brace_;  // world frame
  RTCDevice device_;
};

}  // namespace lightstage::sim
