// What is known about a rig without asking its devices again: enough to check a plan and to foresee
// what it costs.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "daemon/config/rig_file.h"
#include "drivers/api/axis.h"
#include "drivers/api/camera.h"
#include "drivers/api/lamps.h"
#include "drivers/api/projector.h"
#include "optics/rig_geometry.h"

namespace lightstage {

// Constant while the daemon runs; may be read from any thread.
struct RigFacts {
  std::optional<AxisInfo> turntable;  // absent: it stands at azimuth 0°
  std::optional<AxisInfo> tilt;       // absent: it stands at tilt 0°
  std::optional<LampsInfo> lamps;
  std::optional<ProjectorInfo> projector;
  CameraInfo camera;
  CameraConfig camera_config;  // as applied
  // Camera::ValidateExposure. Any thread.
  std::function<ExposureResult(Duration)> validate_exposure;
  std::vector<Duration> default_exposures;  // the rig file's bracket
  LimitOptions limits;
  RigGeometry geometry;
  std::string compression;  // of basis images, as in StoreOptions
};

}  // namespace lightstage
