// A device of the rig together with the other end of its wire, where this process serves that itself (sim/peers): the ordinary driver's
// device, which says what it is by the driver's name of the pair. The peer outlives the device.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "drivers/api/axis.h"
#include "drivers/api/camera.h"
#include "drivers/api/lamps.h"
#include "drivers/api/projector.h"

namespace lightstage::sim {

// What all have in common. `Info` is the device's.
template <class Device, class Info>
class ServedDevice : public Device {
 public:
  ServedDevice(std::shared_ptr<void> peer, std::unique_ptr<Device> device,
               const std::string& driver)
      : peer_(std::move(peer)), device_(std::move(device)), info_(device_->info()) {
    info_.identity.driver = driver;
  }
  const Info& info() const override { return info_; }

 protected:
  Device& device() const { return *device_; }

 private:
  const std::shared_ptr<void> peer_;  // whatever serves it; maybe for other devices too
  const std::unique_ptr<Device> device_;
  Info info_;
};

class ServedCamera final : public ServedDevice<Camera, CameraInfo> {
 public:
  using ServedDevice::ServedDevice;
  ConfigResult Validate(const CameraConfig& config) const override {
    return device().Validate(config);
  }
  ExposureResult ValidateExposure(Duration exposure) const override {
    return device().ValidateExposure(exposure);
  }
  void Configure(const CameraConfig& config, TimePoint deadline,
                 Completion<CameraConfig> done) override {
    device().Configure(config, deadline, std::move(done));
  }
  void Arm(TimePoint deadline, Completion<CameraConfig> done) override {
    device().Arm(deadline, std::move(done));
  }
  void Trigger(Duration exposure, TimePoint deadline, Completion<ExposureEnd> exposure_ended,
               Completion<Frame> frame_ready) override {
    device().Trigger(exposure, deadline, std::move(exposure_ended), std::move(frame_ready));
  }
  void Disarm(TimePoint deadline, Completion<CameraConfig> done) override {
    device().Disarm(deadline, std::move(done));
  }
};

class ServedAxis final : public ServedDevice<Axis, AxisInfo> {
 public:
  using ServedDevice::ServedDevice;
  void Home(TimePoint deadline, Completion<AxisState> done) override {
    device().Home(deadline, std::move(done));
  }
  void Move(Angle target, double velocity_dps, TimePoint deadline,
            Completion<AxisState> done) override {
    device().Move(target, velocity_dps, deadline, std::move(done));
  }
  void Turn(double velocity_dps, TimePoint deadline, Completion<AxisState> done) override {
    device().Turn(velocity_dps, deadline, std::move(done));
  }
  void Read(TimePoint deadline, Completion<AxisState> done) override {
    device().Read(deadline, std::move(done));
  }
  void Stop(TimePoint deadline, Completion<AxisState> done) override {
    device().Stop(deadline, std::move(done));
  }
};

class ServedLamps final : public ServedDevice<Lamps, LampsInfo> {
 public:
  using ServedDevice::ServedDevice;
  void Set(const std::vector<float>& levels, TimePoint deadline,
           Completion<LampsState> done) override {
    device().Set(levels, deadline, std::move(done));
  }
  void Dark(TimePoint deadline, Completion<LampsState> done) override {
    device().Dark(deadline, std::move(done));
  }
  void Check(TimePoint deadline, Completion<std::monostate> done) override {
    device().Check(deadline, std::move(done));
  }
  absl::Status SetTimeToDark(Duration time) override { return device().SetTimeToDark(time); }
  absl::Status Refresh() override { return device().Refresh(); }
};

class ServedProjector : public ServedDevice<Projector, ProjectorInfo> {
 public:
  using ServedDevice::ServedDevice;
  void Show(const Pattern& pattern, TimePoint deadline, Completion<ProjectorState> done) override {
    device().Show(pattern, deadline, std::move(done));
  }
  void Black(TimePoint deadline, Completion<ProjectorState> done) override {
    device().Black(deadline, std::move(done));
  }
  void Check(TimePoint deadline, Completion<std::monostate> done) override {
    device().Check(deadline, std::move(done));
  }
};

}  // namespace lightstage::sim
