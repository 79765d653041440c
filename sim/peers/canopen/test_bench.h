// What the tests of this folder stand on: the simulated world, a bus within the process, and the driver's devices on it.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "drivers/canopen/memory_bus.h"
#include "drivers/canopen/open.h"
#include "sim/peers/canopen/drive.h"
#include "sim/peers/canopen/output_module.h"
#include "sim/rig/test_rig.h"

namespace lightstage::sim {

// Generous, because a busy machine must not make a node seem lost; tests of just that set less.
constexpr char kPatient[] = "interface = \"can0\"\nanswer_ms = 1000\nheartbeat_ms = 30000\n";

// Fast, so that the suites do not take long.
constexpr char kTurntable[] =
    "node = 5\ncontinuous = true\nunits_per_turn = 36000\nmax_velocity_dps = 360\n"
    "max_acceleration_dps2 = 3600\nsettle_ms = 10\nhoming_method = 19\nhoming_velocity_dps = 360\n"
    "poll_ms = 5\nsetpoint_ms = 400\n";

constexpr char kDigitalLamps[] = "node = 9\noutput = \"digital\"\nsettle_ms = 1\n";

template <class Options>
Options Parsed(const std::string& toml, Options (*parse)(const TomlTable&)) {
  absl::StatusOr<TomlDocument> document = TomlDocument::Parse(toml, "rig.toml");
  EXPECT_TRUE(document.ok()) << document.status();
  Options options = parse(document->root());
  EXPECT_TRUE(document->Finish().ok()) << document->Finish();
  return options;
}

inline canopen::AxisOptions AxisToml(const std::string& toml) {
  return Parsed(toml, canopen::ParseAxisOptions);
}
inline canopen::LampsOptions LampsToml(const std::string& toml) {
  return Parsed(toml, canopen::ParseLampsOptions);
}

class TestBench {
 public:
  TestBench() : wire_(clock_) {
    WorldOptions options;
    options.samples = 1;
    world_ = *World::Create(options, geometry_, clock_);
    bus_ = std::make_shared<canopen::CanBus>(
        "can0", clock_, [this]() -> absl::StatusOr<std::unique_ptr<canopen::CanPort>> {
          auto port = wire_.Attach();
          master_ = port.get();
          return port;
        });
  }

  void AddDrive(const DriveOptions& options = {}) {
    drive_ = std::make_unique<CanopenDrive>(wire_.Attach(), options, world_);
  }
  void AddOutputs(const OutputModuleOptions& options = {}) {
    outputs_ = std::make_unique<CanopenOutputModule>(wire_.Attach(), options, world_);
  }

  absl::StatusOr<std::unique_ptr<Axis>> OpenAxis(const std::string& toml) {
    return canopen::OpenAxis({"turntable", &clock_, &geometry_}, "canopen", AxisToml(toml), bus_);
  }
  absl::StatusOr<std::unique_ptr<Lamps>> OpenLamps(const std::string& toml) {
    return canopen::OpenLamps({"lamps", &clock_, &geometry_}, "canopen", LampsToml(toml), bus_);
  }

  // The driver's end of the wire.
  canopen::CanPort& master() { return *master_; }
  Clock& clock() { return clock_; }
  canopen::MemoryBus& wire() { return wire_; }
  World& world() { return *world_; }
  CanopenDrive& drive() { return *drive_; }
  CanopenOutputModule& outputs() { return *outputs_; }
  const std::shared_ptr<canopen::CanBus>& bus() { return bus_; }
  const RigGeometry& geometry() { return geometry_; }

  TimePoint Soon() { return clock_.Now() + std::chrono::seconds(30); }
  AxisState Truth(AxisRole role = AxisRole::kTurntable) {
    return world_->AxisAt(role, clock_.Now());
  }
  std::vector<float> Light() { return world_->LampLevels(clock_.Now()); }
  // Looks every few milliseconds until `ready` or some seconds have passed.
  bool Becomes(absl::FunctionRef<bool()> ready) {
    const TimePoint deadline = Soon();
    while (!ready()) {
      if (clock_.Now() > deadline) return false;
      SleepFor(clock_, std::chrono::milliseconds(3));
    }
    return true;
  }

 private:
  RealClock clock_;
  const RigGeometry geometry_ = Rig();
  canopen::MemoryBus wire_;
  std::shared_ptr<World> world_;
  std::unique_ptr<CanopenDrive> drive_;
  std::unique_ptr<CanopenOutputModule> outputs_;
  canopen::CanPort* master_ = nullptr;
  std::shared_ptr<canopen::CanBus> bus_;
};

}  // namespace lightstage::sim
