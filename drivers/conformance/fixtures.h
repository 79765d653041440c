// What a driver gives to be checked against the contracts of drivers/api. In the driver's own test:
//
//   const bool kRegistered = RegisterCameraConformance("Aravis", [] { return
//   std::make_unique<MyFixture>(); });
//
// adds one test per rule, each with a fixture and a device of its own. A rule that a device can not
// show (a second trigger is never too early for a camera that is done at once) passes.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "drivers/api/axis.h"
#include "drivers/api/camera.h"
#include "drivers/api/lamps.h"
#include "drivers/api/projector.h"

namespace lightstage {

template <class Device>
class DeviceFixture {
 public:
  virtual ~DeviceFixture() = default;
  virtual Clock& clock() = 0;
  // Called once per fixture. The device is destroyed before the fixture.
  virtual absl::StatusOr<std::unique_ptr<Device>> Open() = 0;
  // Longer than any operation of the device can take on a busy machine.
  virtual Duration patience() const { return std::chrono::seconds(20); }
};

class CameraFixture : public DeviceFixture<Camera> {
 public:
  // What the frames are taken with; default: the whole sensor in the first format.
  virtual CameraConfig config(const CameraInfo& info) const;
  // How often a frame may be retaken after DATA_LOSS: the link of some cameras loses packets.
  virtual int retakes() const { return 0; }
};

class AxisFixture : public DeviceFixture<Axis> {};

class LampsFixture : public DeviceFixture<Lamps> {
 public:
  // The light that is really on, by lamp; nothing if this rig can not look. May be asked before
  // Open and after closing.
  virtual std::optional<std::vector<float>> Emitted() { return std::nullopt; }
};

class ProjectorFixture : public DeviceFixture<Projector> {
 public:
  // The pattern that is really on the wall; nothing if this rig can not look. May be asked before
  // Open and after closing.
  virtual std::optional<Pattern> OnWall() { return std::nullopt; }
};

template <class Fixture>
using FixtureFactory = std::function<std::unique_ptr<Fixture>()>;

// Each adds the suite "<Contract>Conformance/<name>". To be called before main; the result is
// always true.
bool RegisterCameraConformance(const std::string& name, FixtureFactory<CameraFixture> make);
bool RegisterAxisConformance(const std::string& name, FixtureFactory<AxisFixture> make);
bool RegisterLampsConformance(const std::string& name, FixtureFactory<LampsFixture> make);
bool RegisterProjectorConformance(const std::string& name, FixtureFactory<ProjectorFixture> make);

}  // namespace lightstage
