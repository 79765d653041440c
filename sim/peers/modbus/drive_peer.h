// A drive with Modbus registers that turns an axis of the simulated world: what the modbus driver can be shown without a drive. The register
// maps are written from the makers' manuals, apart from the driver's profiles.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "absl/base/thread_annotations.h"
#include "absl/status/statusor.h"
#include "base/mutex.h"
#include "sim/peers/modbus/server.h"
#include "sim/rig/world.h"

namespace lightstage::sim {

struct DrivePeerOptions {
  std::string kind = "generic";  // as the driver's profile
  AxisRole role = AxisRole::kTurntable;
  double steps_per_degree = 1000;
  double steps_per_rev = 10000;
  // What its motor can do.
  double max_velocity_dps = 2000, max_acceleration_dps2 = 20000;
  uint32_t serial = 4711;
};

// drive_maps.h
struct DriveMap;
enum class DriveAction;

class ModbusDrivePeer final : public ModbusDevice {
 public:
  static bool Knows(const std::string& kind);
  // The world must be on real time. INVALID_ARGUMENT / PEER_NOT_STARTED if there is no such kind.
  static absl::StatusOr<std::shared_ptr<ModbusDrivePeer>> Create(const DrivePeerOptions& options,
                                                                 std::shared_ptr<World> world);
  ModbusAnswer Handle(const ModbusRequest& request) override;

  // ---- Faults; any thread.

  void Fail(uint32_t code);                      // stops with a fault until it is cleared
  void FailForGood(bool fails);                  // clearing does not help
  void Freeze(bool frozen);                      // the position read stays what it is
  void BeDeaf(bool deaf);                        // takes commands and does nothing
  void SwapWords(bool position, bool commands);  // long numbers in the other order
  void Scale(double factor);                     // the position read counts so many times as much
  void SetSerial(uint32_t serial);               // another drive
  void PowerCycle();                             // forgets where it is; stops

  // ---- What it was told; any thread.

  int moves() const;
  int homings() const;
  int halts() const;

 private:
  ModbusDrivePeer(const DrivePeerOptions& options, const DriveMap& map,
                  std::shared_ptr<World> world);
  std::optional<uint16_t> GetLocked(int address) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  int ActLocked(DriveAction action) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);  // an exception, or 0
  int MoveLocked() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void HomeLocked() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void BrakeLocked() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void UpdateLocked() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  bool MovingLocked() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  uint16_t StatusLocked() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  int64_t PositionLocked() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  int64_t WrittenLocked(int address, int words, bool is_signed)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const DrivePeerOptions o_;
  const DriveMap& map_;
  const std::shared_ptr<World> world_;  // shared: all devices of a rig are in one world

  mutable Mutex mutex_;
  std::map<int, uint16_t> written_ ABSL_GUARDED_BY(mutex_);
  int64_t offset_ ABSL_GUARDED_BY(mutex_) = 0;  // of its count from the world's angle, steps
  TimePoint busy_until_ ABSL_GUARDED_BY(mutex_){};
  bool enabled_ ABSL_GUARDED_BY(mutex_) = false, homed_ ABSL_GUARDED_BY(mutex_) = false,
                homing_ ABSL_GUARDED_BY(mutex_) = false;
  uint32_t fault_ ABSL_GUARDED_BY(mutex_) = 0;
  bool for_good_ ABSL_GUARDED_BY(mutex_) = false, deaf_ ABSL_GUARDED_BY(mutex_) = false,
                 swap_position_ ABSL_GUARDED_BY(mutex_) = false,
                 swap_commands_ ABSL_GUARDED_BY(mutex_) = false;
  double scale_ ABSL_GUARDED_BY(mutex_) = 1;
  std::optional<int64_t> frozen_ ABSL_GUARDED_BY(mutex_);
  uint32_t serial_ ABSL_GUARDED_BY(mutex_) = 0;
  int moves_ ABSL_GUARDED_BY(mutex_) = 0, homings_ ABSL_GUARDED_BY(mutex_) = 0,
             halts_ ABSL_GUARDED_BY(mutex_) = 0;
};

}  // namespace lightstage::sim
