// A CiA 402 drive as an axis: profile position, profile velocity and homing mode, commanded by SDO, watched by TPDO 1 or SDO.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "drivers/canopen/cia402.h"
#include "drivers/canopen/node.h"
#include "drivers/canopen/options.h"
#include "drivers/link/axis_link.h"

namespace lightstage::canopen {

// AxisLink's errors, and FAILED_PRECONDITION / SETPOINT_NOT_ACKNOWLEDGED (StartMove), / HOMING_FAILED (Read after StartHome) and
// / DEVICE_UNSUITABLE (Connect), OUT_OF_RANGE / AXIS_LIMIT where the drive's own limits end before the rig's, or its counter does.
class CanopenAxisLink final : public AxisLink {
 public:
  CanopenAxisLink(const std::string& device, const AxisOptions& options,
                  std::shared_ptr<CanBus> bus);
  // Takes the power off if the drive stands.
  ~CanopenAxisLink() override;

  absl::Status Connect() override;
  AxisInfo info() const override;
  absl::StatusOr<AxisReading> Read() override;
  absl::Status StartHome() override;
  absl::Status StartMove(Angle target, double velocity_dps) override;
  absl::Status StartTurn(double velocity_dps, Duration longest) override;
  absl::Status Halt() override;

  // The drive's statusword and position come by TPDO 1.
  bool by_pdo() const { return by_pdo_; }

 private:
  // What it is doing, as far as it was told.
  enum class Motion { kNone, kHoming, kMove, kTurn, kHalt };
  struct Look {
    uint16_t status = 0;
    int32_t position = 0;
  };

  double ToUnits(Angle angle) const;
  Angle FromUnits(double units) const;

  absl::StatusOr<Look> LookNow();
  absl::StatusOr<uint16_t> ReadStatus();
  absl::StatusOr<DriveState> ReadState();
  absl::StatusOr<double> ReadVelocity();  // °/s, rig's sense
  absl::Status Control(uint16_t word);
  absl::Status SetMode(int8_t mode);
  absl::Status Enable();
  absl::Status ResetFault();
  // Into `mode`, and enabled. A halt stays.
  absl::Status Prepare(int8_t mode);
  absl::StatusOr<bool> OfferSetpoint();
  // Waits until (statusword & mask) == value; false after `patience`.
  absl::StatusOr<bool> AwaitStatus(uint16_t mask, uint16_t value, Duration patience);
  absl::StatusOr<bool> HomingMoves(uint16_t status);
  absl::Status DriveFault(DriveState state);

  absl::StatusOr<bool> MapStatusPdo();
  absl::Status WatchEachOther();
  absl::Status SetRamps();
  absl::Status CheckLimits();
  absl::Status ComeToRest();

  const AxisOptions options_;
  Node node_;
  std::optional<NodeIdentity> identity_;
  bool connected_ = false;
  bool by_pdo_ = false;
  bool homed_ = false;
  bool brakes_alone_ = false;  // it watches our heartbeat, and quick-stops without
  int8_t mode_ = 0;            // 6061h as last confirmed; 0: unknown
  uint16_t control_ = 0;
  Motion motion_ = Motion::kNone;
  TimePoint homing_since_{};
  bool homing_seen_ = false;  // the drive said that it is homing
  // The drive's own software limits, if it has any.
  std::optional<std::pair<int32_t, int32_t>> drive_limits_;
};

}  // namespace lightstage::canopen
