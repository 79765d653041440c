// What the renderer makes of the rig file: the scene with everything that rides on the turntable, and the projector's lens.
#pragma once

#include "absl/status/statusor.h"
#include "optics/rig_geometry.h"
#include "sim/render/illuminate.h"
#include "sim/render/scene.h"
#include "sim/rig/options.h"

namespace lightstage::sim {

// The object and the camera's body. The scene's own errors; INVALID_ARGUMENT / LAMP_UNKNOWN if the options
// dim a lamp that the rig does not have; FAILED_PRECONDITION / INSIDE_OBJECT if the camera stands in an object.
absl::StatusOr<Scene> MakeWorldScene(const WorldOptions& options, const RigGeometry& geometry);

LensOptions LensOf(const ProjectorOptics& optics, const ProjectorGeometry& projector);

}  // namespace lightstage::sim
