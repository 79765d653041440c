// A relay or dimmer board with Modbus that lights the lamps of the simulated world.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "base/mutex.h"
#include "sim/peers/modbus/server.h"
#include "sim/rig/world.h"

namespace lightstage::sim {

struct LampsPeerOptions {
  int first_lamp = 0, lamps = 0;  // of the world that are on this board
  int first_address = 0;
  int full = 0;                // holding registers with this value of full light; 0: coils
  bool inverted = false;       // a coil that is on makes its lamp dark
  bool single_writes = false;  // knows functions 5 and 6, not 15 and 16
  int watchdog = -1;           // holding register: dark after so many steps without a write of it
  Duration watchdog_step{};
};

class ModbusLampsPeer final : public ModbusDevice {
 public:
  // The world must be on real time.
  ModbusLampsPeer(const LampsPeerOptions& options, std::shared_ptr<World> world);
  ModbusAnswer Handle(const ModbusRequest& request) override;
  void Tick() override;

  // ---- Faults; any thread.

  void Stick(std::optional<int> lamp);  // this one keeps the level it has
  void PowerCycle();                    // comes back dark
  void ReadBackLate(Duration late);     // what is read changes so long after it was written

 private:
  uint16_t DarkValue() const { return o_.full == 0 && o_.inverted ? 1 : 0; }
  void ShineLocked() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void RestartLocked() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const LampsPeerOptions o_;
  const std::shared_ptr<World> world_;  // shared: all devices of a rig are in one world
  Mutex mutex_;
  std::vector<uint16_t> values_ ABSL_GUARDED_BY(mutex_), read_ ABSL_GUARDED_BY(mutex_);
  TimePoint read_at_ ABSL_GUARDED_BY(mutex_){};  // read_ becomes values_
  Duration late_ ABSL_GUARDED_BY(mutex_){};
  uint16_t watchdog_ ABSL_GUARDED_BY(mutex_) = 0;
  TimePoint dark_at_ ABSL_GUARDED_BY(mutex_) = kNever;
  std::optional<int> stuck_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace lightstage::sim
