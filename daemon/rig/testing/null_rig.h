// A rig of null devices, or of whatever a test puts in their place. For tests and benchmarks.
#pragma once

#include <memory>
#include <utility>

#include "base/status.h"
#include "daemon/rig/rig.h"
#include "drivers/conformance/null_devices.h"

namespace lightstage {

// An opener that hands out `device` the one time it is asked.
template <class Device>
DeviceTable<Device> TableOf(std::unique_ptr<Device> device) {
  DeviceTable<Device> table;
  table.driver = "test";
  table.present = true;
  table.open = [device = std::move(device)](
                   const DeviceContext&) mutable -> absl::StatusOr<std::unique_ptr<Device>> {
    return std::move(device);
  };
  return table;
}

inline AxisInfo TestAxisInfo(const char* name, bool continuous, double min, double max) {
  AxisInfo info;
  info.identity.name = name;
  info.continuous = continuous;
  info.min = Degrees(min);
  info.max = Degrees(max);
  info.max_velocity_dps = 60;
  info.max_acceleration_dps2 = 120;
  info.tolerance = Degrees(0.01);
  return info;
}

// 40 lamps, both axes, a projector, an 8×6 Mono8 camera.
inline std::unique_ptr<RigFile> NullRigFile(Clock& clock) {
  auto file = std::make_unique<RigFile>();
  file->name = "null";
  file->virtual_time = clock.is_virtual();
  file->geometry.brace.radius = Meters(1);
  for (int i = 0; i < 40; ++i)
    file->geometry.brace.lamps.push_back(
        {Degrees(i < 20 ? 0 : 180), Degrees(4.5 * (i % 20) + 2.25)});
  file->geometry.projector = {true, Meters(1), Degrees(0), Degrees(20), 64, 64};
  file->limits = {
      Degrees(-720), Degrees(720), Degrees(0), Degrees(90), std::chrono::seconds(1), 8, 40};
  file->camera_options.config = {PixelFormat::kMono8, 8, 6, 0};
  file->camera_options.exposures = {std::chrono::milliseconds(1)};
  file->engine.max_attempts = 3;
  file->engine.device_timeout = std::chrono::seconds(1);
  file->engine.heartbeat = std::chrono::seconds(2);
  file->develop.workers = 1;
  file->develop.saturation = 0.98;
  file->store.compression = "piz";
  file->store.queue_shots = 8;
  file->camera = TableOf<Camera>(std::make_unique<NullCamera>(clock, 8, 6));
  file->turntable =
      TableOf<Axis>(std::make_unique<NullAxis>(TestAxisInfo("turntable", true, 0, 360)));
  file->tilt = TableOf<Axis>(std::make_unique<NullAxis>(TestAxisInfo("tilt", false, 0, 90)));
  file->lamps = TableOf<Lamps>(std::make_unique<NullLamps>(40));
  file->projector = TableOf<Projector>(std::make_unique<NullProjector>(64, 64));
  return file;
}

}  // namespace lightstage
