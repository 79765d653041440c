// What the tests of this folder have in common: a world, peers that move and light it, and devices of the modbus driver on them.
#pragma once

#include <memory>
#include <string>
#include <utility>

#include "absl/functional/function_ref.h"
#include "base/status.h"
#include "drivers/modbus/driver.h"
#include "sim/peers/modbus/drive_peer.h"
#include "sim/peers/modbus/lamps_peer.h"
#include "sim/rig/test_rig.h"

namespace lightstage::sim {

enum class Wire { kTcp, kRtu };

class ModbusBench {
 public:
  // With the lamps of the test rig, or more.
  explicit ModbusBench(int lamps = 3) {
    for (int i = 3; i < lamps; ++i) {
      geometry_.brace.lamps.push_back({Degrees(i), Degrees(45)});
    }
    world_ = *World::Create({}, geometry_, clock_);
  }

  absl::Status Serve(Wire wire, ModbusServer::Devices devices) {
    ASSIGN_OR_RETURN(server_, wire == Wire::kTcp ? ModbusServer::StartTcp(std::move(devices))
                                                 : ModbusServer::StartRtu(std::move(devices)));
    line_ = wire == Wire::kTcp
                ? absl::StrCat("host = \"127.0.0.1\"\nport = ", server_->port(), "\n")
                : absl::StrCat("serial_port = \"", server_->serial_port(),
                               "\"\nbaud = 115200\nparity = \"none\"\n");
    return absl::OkStatus();
  }

  // `keys`: the device's table without its line.
  template <class Device>
  absl::StatusOr<std::unique_ptr<Device>> Open(const Driver<Device>& driver, const char* name,
                                               const std::string& keys) {
    ASSIGN_OR_RETURN(TomlDocument document,
                     TomlDocument::Parse(absl::StrCat("[", name, "]\n", line_, keys), "rig.toml"));
    DeviceOpener<Device> open = driver.parse(document.root().Table(name));
    RETURN_IF_ERROR(document.Finish());
    return open({name, &clock_, &geometry_});
  }

  Clock& clock() { return clock_; }
  const std::shared_ptr<World>& world() { return world_; }
  ModbusServer& server() { return *server_; }
  TimePoint In(Duration time) { return clock_.Now() + time; }
  // Whether it does so in reasonable time.
  bool Becomes(absl::FunctionRef<bool()> condition) {
    const TimePoint give_up = In(std::chrono::seconds(20));
    while (!condition()) {
      if (clock_.Now() > give_up) return false;
      SleepFor(clock_, std::chrono::milliseconds(1));
    }
    return true;
  }

 private:
  RealClock clock_;
  RigGeometry geometry_ = Rig();
  std::shared_ptr<World> world_;
  std::unique_ptr<ModbusServer> server_;
  std::string line_;
};

}  // namespace lightstage::sim
