// A rig on paper for this room's tests: 40 lamps, a limited tilt axis, an endless turntable, round
// numbers.
#pragma once

#include "daemon/capture/rig_facts.h"

namespace lightstage {

inline AxisInfo TestAxis(const char* name, Angle min, Angle max, bool continuous, double dps) {
  AxisInfo axis;
  axis.identity.name = name;
  axis.min = min;
  axis.max = max;
  axis.continuous = continuous;
  axis.max_velocity_dps = dps;
  axis.max_acceleration_dps2 = 10 * dps;  // a tenth of a second to full speed
  axis.settle = std::chrono::milliseconds(100);
  return axis;
}

inline RigFacts TestRig() {
  RigFacts facts;
  facts.turntable = TestAxis("turntable", Degrees(0), Degrees(0), true, 90);
  facts.tilt = TestAxis("tilt", Degrees(0), Degrees(90), false, 30);
  facts.lamps.emplace();
  facts.lamps->count = 40;
  facts.lamps->settle = std::chrono::milliseconds(5);
  facts.projector.emplace();
  facts.projector->width = 1024;
  facts.projector->height = 768;
  facts.projector->settle = std::chrono::milliseconds(20);
  facts.camera.min_exposure = std::chrono::microseconds(10);
  facts.camera.max_exposure = std::chrono::seconds(10);
  facts.camera.readout = std::chrono::milliseconds(30);
  facts.camera_config = {PixelFormat::kRGB16, 100, 50, 0};
  // A camera with a step of 10 us that refuses what is outside its range.
  facts.validate_exposure = [](Duration asked) -> ExposureResult {
    using std::chrono::microseconds;
    if (asked < microseconds(10) || asked > std::chrono::seconds(10)) {
      return {ConfigVerdict::kInvalid, asked, "out of range"};
    }
    Duration real = (asked + microseconds(5)) / microseconds(10) * microseconds(10);
    if (real == asked) return {ConfigVerdict::kValid, asked, ""};
    return {ConfigVerdict::kAdjusted, real, "exposure adjusted"};
  };
  facts.default_exposures = {std::chrono::milliseconds(1), std::chrono::milliseconds(8)};
  facts.limits = {
      Degrees(-360), Degrees(360), Degrees(0), Degrees(90), std::chrono::seconds(5), 4, 40};
  facts.compression = "none";
  return facts;
}

}  // namespace lightstage
