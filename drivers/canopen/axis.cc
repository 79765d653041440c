#include "drivers/canopen/axis.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_format.h"
#include "base/status.h"
#include "drivers/canopen/identity.h"

namespace lightstage::canopen {
namespace {

using std::chrono::milliseconds;

// CiA 402 objects.
constexpr ObjectAddress kAbortOption{0x6007, 0}, kErrorCode{0x603F, 0}, kControlword{0x6040, 0},
    kStatusword{0x6041, 0}, kMode{0x6060, 0}, kModeDisplay{0x6061, 0}, kPosition{0x6064, 0},
    kVelocity{0x606C, 0}, kTarget{0x607A, 0}, kTargetVelocity{0x60FF, 0},
    kProfileVelocity{0x6081, 0}, kProfileAcceleration{0x6083, 0}, kProfileDeceleration{0x6084, 0},
    kHomingMethod{0x6098, 0}, kHomingFast{0x6099, 1}, kHomingSlow{0x6099, 2},
    kHomingAcceleration{0x609A, 0}, kSupportedModes{0x6502, 0};
constexpr uint16_t kPositionRangeLimit = 0x607B, kSoftwareLimit = 0x607D;
// CiA 301 objects.
constexpr ObjectAddress kConsumerHeartbeat{0x1016, 1};
constexpr uint16_t kTpdo1Parameters = 0x1800, kTpdo1Mapping = 0x1A00;

const MappedObject kStatusMapping[] = {{kStatusword, 16}, {kPosition, 32}};

// Object 6007h when the drive misses this computer's heartbeat.
constexpr int kAbortByQuickStop = 3;
constexpr uint8_t kEventDriven = 255;

// Between two looks while waiting for the drive to do what it was told.
constexpr Duration kLook = milliseconds(2), kVelocityLook = milliseconds(20);
// For a standstill when connecting.
constexpr Duration kRestTime = std::chrono::seconds(5);

double PerTurn(double degrees, double units) { return std::round(std::abs(degrees) / 360 * units); }

bool IsWholeRange(int32_t low, int32_t high) { return low <= -INT32_MAX && high >= INT32_MAX - 1; }

}  // namespace

CanopenAxisLink::CanopenAxisLink(const std::string& device, const AxisOptions& options,
                                 std::shared_ptr<CanBus> bus)
    : options_(options),
      node_(device, std::move(bus), options.node.node, options.node.answer_time, options.node.eds) {
}

CanopenAxisLink::~CanopenAxisLink() {
  if (connected_ && node_.Check().ok()) {
    absl::StatusOr<AxisReading> reading = Read();
    absl::StatusOr<DriveState> state = ReadState();
    const bool stands = reading.ok() && !reading->moving;
    if (stands && state.ok() && *state == DriveState::kOperationEnabled) {
      Control(kControlShutdown).IgnoreError();
    }
    // It is not to take our leaving for a failure.
    node_.WriteOptional(kConsumerHeartbeat, 0, 4).IgnoreError();
  }
  node_.bus().RemoveHeartbeat(this);
}

double CanopenAxisLink::ToUnits(Angle angle) const {
  return (angle - options_.zero).degrees() / 360 * options_.units_per_turn;
}

Angle CanopenAxisLink::FromUnits(double units) const {
  return options_.zero + Degrees(units / options_.units_per_turn * 360);
}

// ---- Connecting

absl::Status CanopenAxisLink::Connect() {
  connected_ = by_pdo_ = homed_ = false;
  mode_ = 0;
  motion_ = Motion::kNone;
  RETURN_IF_ERROR(node_.Attach());
  // A stopped node answers nothing, and mappings are changed in pre-operational.
  RETURN_IF_ERROR(node_.bus().Send(EncodeNmt(NmtCommand::kPreOperational, node_.id())));
  ASSIGN_OR_RETURN(const NodeIdentity identity, node_.ReadIdentity());
  RETURN_IF_ERROR(CheckIdentity(node_, options_.node, identity, kProfileDrive, identity_));
  RETURN_IF_ERROR(WatchEachOther());
  if (options_.use_pdo) {
    ASSIGN_OR_RETURN(by_pdo_, MapStatusPdo());
  }
  RETURN_IF_ERROR(CheckLimits());
  RETURN_IF_ERROR(SetRamps());
  RETURN_IF_ERROR(node_.Start(options_.node.heartbeat * 2));
  RETURN_IF_ERROR(ComeToRest());
  identity_ = identity;
  RETURN_IF_ERROR(node_.Check());
  connected_ = true;
  return absl::OkStatus();
}

absl::Status CanopenAxisLink::WatchEachOther() {
  const NodeOptions& o = options_.node;
  RETURN_IF_ERROR(node_.WatchHeartbeat(o.heartbeat));
  RETURN_IF_ERROR(node_.bus().AddHeartbeat(o.heartbeat_id, o.heartbeat / 3, this));
  const auto time = static_cast<uint16_t>(o.heartbeat / milliseconds(1));
  ASSIGN_OR_RETURN(
      const bool watches,
      node_.WriteOptional(kConsumerHeartbeat, ConsumerHeartbeat(o.heartbeat_id, time), 4));
  ASSIGN_OR_RETURN(const bool brakes, node_.WriteOptional(kAbortOption, kAbortByQuickStop, 2));
  brakes_alone_ = watches && brakes;
  if (!brakes_alone_) {
    spdlog::warn(
        "{} {}: it goes on moving to its target if this daemon dies, and is not turned without one",
        node_.Where(),
        watches ? "has no abort connection option code (6007h)"
                : "can not watch this computer's heartbeat (1016h)");
  }
  return absl::OkStatus();
}

absl::StatusOr<bool> CanopenAxisLink::MapStatusPdo() {
  constexpr uint32_t kInvalid = 0x80000000, kNoRemote = 0x40000000;
  auto object = [](uint16_t index, uint8_t sub) { return ObjectAddress{index, sub}; };
  auto map = [&]() -> absl::Status {
    ASSIGN_OR_RETURN(const uint32_t before, node_.ReadUnsigned(object(kTpdo1Parameters, 1)));
    const uint32_t id = (before & kNoRemote) | static_cast<uint32_t>(kTpdo1 + node_.id());
    RETURN_IF_ERROR(node_.WriteInteger(object(kTpdo1Parameters, 1), kInvalid | id, 4));
    RETURN_IF_ERROR(node_.WriteInteger(object(kTpdo1Mapping, 0), 0, 1));
    uint8_t count = 0;
    for (const MappedObject& mapped : kStatusMapping) {
      RETURN_IF_ERROR(node_.WriteInteger(object(kTpdo1Mapping, ++count), EncodeMapping(mapped), 4));
    }
    RETURN_IF_ERROR(node_.WriteInteger(object(kTpdo1Mapping, 0), count, 1));
    RETURN_IF_ERROR(node_.WriteInteger(object(kTpdo1Parameters, 2), kEventDriven, 1));
    RETURN_IF_ERROR(
        node_.WriteInteger(object(kTpdo1Parameters, 5), options_.poll / milliseconds(1), 2));
    return node_.WriteInteger(object(kTpdo1Parameters, 1), id, 4);
  };
  absl::Status mapped = map();
  if (mapped.ok()) return true;
  const std::string reason = ErrorReason(mapped);
  if (reason != "OBJECT_MISSING" && reason != "SDO_ABORTED" && reason != "OBJECT_READ_ONLY" &&
      reason != "OBJECT_LIMIT") {
    return mapped;
  }
  spdlog::warn("{}; status and position are read by SDO instead of TPDO 1", MessageOf(mapped));
  return false;
}

absl::Status CanopenAxisLink::CheckLimits() {
  // Nothing if the node has no such object, or it says that there is no limit.
  auto read = [&](uint16_t index) -> absl::StatusOr<std::optional<std::pair<int32_t, int32_t>>> {
    absl::StatusOr<int32_t> low = node_.ReadSigned({index, 1});
    if (IsObjectMissing(low.status())) return std::optional<std::pair<int32_t, int32_t>>();
    RETURN_IF_ERROR(low.status());
    ASSIGN_OR_RETURN(const int32_t high, node_.ReadSigned({index, 2}));
    if (*low >= high || IsWholeRange(*low, high)) {
      return std::optional<std::pair<int32_t, int32_t>>();
    }
    return std::optional(std::pair(*low, high));
  };
  auto unsuitable = [&](const std::string& what) {
    return node_.Fault(absl::StatusCode::kFailedPrecondition, "DEVICE_UNSUITABLE", what);
  };
  ASSIGN_OR_RETURN(drive_limits_, read(kSoftwareLimit));
  if (options_.continuous) {
    if (drive_limits_.has_value()) {
      return unsuitable(absl::StrFormat(
          "has software limits (607Dh: %d to %d units), so it can not turn without end: set both "
          "to 0 in the drive, or continuous = false",
          drive_limits_->first, drive_limits_->second));
    }
    ASSIGN_OR_RETURN(const auto wraps, read(kPositionRangeLimit));
    if (wraps.has_value()) {
      return unsuitable(absl::StrFormat(
          "starts its position anew between %d and %d units (607Bh); it must count on: set both to "
          "0 in the drive",
          wraps->first, wraps->second));
    }
    return absl::OkStatus();
  }
  const double a = ToUnits(options_.min), b = ToUnits(options_.max);
  const double low = std::min(a, b), high = std::max(a, b);
  if (low < INT32_MIN || high > INT32_MAX) {
    return unsuitable(absl::StrFormat(
        "counts in 32 bits; min_deg to max_deg would be %.0f to %.0f units", low, high));
  }
  if (drive_limits_.has_value() && (low < drive_limits_->first || high > drive_limits_->second)) {
    return unsuitable(absl::StrFormat(
        "has software limits (607Dh) of %d to %d units, which are %g to %g deg; the rig file's "
        "min_deg to max_deg, %g to %g deg, must lie within",
        drive_limits_->first, drive_limits_->second, FromUnits(drive_limits_->first).degrees(),
        FromUnits(drive_limits_->second).degrees(), options_.min.degrees(),
        options_.max.degrees()));
  }
  return absl::OkStatus();
}

absl::Status CanopenAxisLink::SetRamps() {
  const double ramp = PerTurn(options_.max_acceleration_dps2, options_.acceleration_units);
  const auto value = static_cast<int64_t>(std::clamp<double>(ramp, 1, UINT32_MAX));
  RETURN_IF_ERROR(node_.WriteInteger(kProfileAcceleration, value, 4));
  // Without one of its own, braking is as accelerating (CiA 402-2, object 6084h).
  return node_.WriteOptional(kProfileDeceleration, value, 4).status();
}

absl::Status CanopenAxisLink::ComeToRest() {
  ASSIGN_OR_RETURN(const DriveState state, ReadState());
  if (state == DriveState::kOperationEnabled) RETURN_IF_ERROR(Halt());
  const TimePoint deadline = node_.clock().Now() + kRestTime;
  while (true) {
    ASSIGN_OR_RETURN(const double velocity, ReadVelocity());
    if (std::abs(velocity) <= options_.standstill_dps) break;
    if (node_.clock().Now() > deadline) {
      return node_.Fault(absl::StatusCode::kFailedPrecondition, "DEVICE_FAULT",
                         absl::StrFormat("still moves at %g deg/s after it was halted", velocity));
    }
    SleepFor(node_.clock(), kLook);
  }
  motion_ = Motion::kNone;
  return absl::OkStatus();
}

AxisInfo CanopenAxisLink::info() const {
  AxisInfo info;
  if (identity_.has_value()) info.identity = Describe(*identity_);
  info.min = options_.min;
  info.max = options_.max;
  info.continuous = options_.continuous;
  info.max_velocity_dps = options_.max_velocity_dps;
  info.max_acceleration_dps2 = options_.max_acceleration_dps2;
  info.settle = options_.settle;
  info.tolerance = options_.tolerance;
  return info;
}

// ---- What it says

absl::StatusOr<uint16_t> CanopenAxisLink::ReadStatus() {
  ASSIGN_OR_RETURN(const uint32_t status, node_.ReadUnsigned(kStatusword));
  return static_cast<uint16_t>(status);
}

absl::StatusOr<DriveState> CanopenAxisLink::ReadState() {
  ASSIGN_OR_RETURN(const uint16_t status, ReadStatus());
  const std::optional<DriveState> state = DecodeStatusword(status);
  if (state.has_value()) return *state;
  return node_.Fault(absl::StatusCode::kInternal, "BAD_ANSWER",
                     absl::StrFormat("has the statusword %04Xh, which is no state", status));
}

absl::StatusOr<double> CanopenAxisLink::ReadVelocity() {
  ASSIGN_OR_RETURN(const std::optional<uint32_t> velocity, node_.ReadOptional(kVelocity));
  if (velocity.has_value()) {
    return static_cast<int32_t>(*velocity) / options_.velocity_units *
           std::copysign(360.0, options_.units_per_turn);
  }
  // A drive that only positions need not have it: by two positions, which at rest may be a unit apart.
  ASSIGN_OR_RETURN(const uint32_t from, node_.ReadUnsigned(kPosition));
  const TimePoint begin = node_.clock().Now();
  SleepFor(node_.clock(), kVelocityLook);
  ASSIGN_OR_RETURN(const uint32_t to, node_.ReadUnsigned(kPosition));
  const auto way = static_cast<int32_t>(to - from);
  if (std::abs(way) <= 1) return 0;
  return way / options_.units_per_turn * 360 / Seconds(node_.clock().Now() - begin);
}

absl::StatusOr<CanopenAxisLink::Look> CanopenAxisLink::LookNow() {
  RETURN_IF_ERROR(node_.Check());
  if (by_pdo_) {
    if (const auto pdo = node_.FreshPdo(2 * options_.poll + milliseconds(10))) {
      const auto values = UnpackPdo(pdo->frame.bytes(), kStatusMapping);
      if (values.has_value()) {
        return Look{static_cast<uint16_t>((*values)[0]), static_cast<int32_t>((*values)[1])};
      }
    }
  }
  Look look;
  ASSIGN_OR_RETURN(look.status, ReadStatus());
  ASSIGN_OR_RETURN(look.position, node_.ReadSigned(kPosition));
  return look;
}

absl::Status CanopenAxisLink::DriveFault(DriveState state) {
  std::string code;
  absl::StatusOr<std::optional<uint32_t>> error = node_.ReadOptional(kErrorCode);
  if (error.ok() && error->has_value()) {
    code = absl::StrFormat(", error code %04Xh (%s)", **error,
                           AbslView(EmergencyName(static_cast<uint16_t>(**error))));
  }
  return node_.Fault(absl::StatusCode::kFailedPrecondition, "DEVICE_FAULT",
                     absl::StrCat("is in the state ", DriveStateName(state), code,
                                  "; homing clears it once its cause is gone"));
}

absl::StatusOr<AxisReading> CanopenAxisLink::Read() {
  ASSIGN_OR_RETURN(const Look look, LookNow());
  if (const auto nmt = node_.nmt_state(); nmt.has_value() && *nmt != NmtState::kOperational) {
    RETURN_IF_ERROR(node_.Check());  // it may have booted since
    return node_.Fault(
        absl::StatusCode::kUnavailable, "DEVICE_LOST",
        absl::StrCat("left the state operational by itself and is ", NmtStateName(*nmt)));
  }
  const std::optional<DriveState> state = DecodeStatusword(look.status);
  if (!state.has_value()) {
    return node_.Fault(absl::StatusCode::kInternal, "BAD_ANSWER",
                       absl::StrFormat("has the statusword %04Xh, which is no state", look.status));
  }
  if (*state == DriveState::kFault || *state == DriveState::kFaultReaction) {
    return DriveFault(*state);
  }
  const bool enabled = *state == DriveState::kOperationEnabled;
  AxisReading reading;
  reading.position = FromUnits(look.position);
  if (!enabled && motion_ != Motion::kNone && motion_ != Motion::kHalt) {
    motion_ = Motion::kNone;
    return node_.Fault(absl::StatusCode::kFailedPrecondition, "DEVICE_FAULT",
                       absl::StrCat("left the state operation enabled on the way and is ",
                                    DriveStateName(*state), ": is its enable input on?"));
  }
  if (motion_ == Motion::kHoming) {
    ASSIGN_OR_RETURN(reading.moving, HomingMoves(look.status));
  } else if (motion_ == Motion::kMove) {
    if ((look.status & kStatusFollowingError) != 0) {
      return node_.Fault(absl::StatusCode::kFailedPrecondition, "DEVICE_FAULT",
                         "reports a following error: it could not keep to its path");
    }
    reading.moving = (look.status & kStatusTargetReached) == 0;
  } else {
    if (motion_ == Motion::kTurn && (look.status & kStatusSlips) != 0) {
      return node_.Fault(absl::StatusCode::kFailedPrecondition, "DEVICE_FAULT",
                         "reports the greatest slippage: it could not keep to its velocity");
    }
    ASSIGN_OR_RETURN(const double velocity, ReadVelocity());
    // With the halt bit, target reached says that it stands.
    const bool profile = mode_ == kModeProfilePosition || mode_ == kModeProfileVelocity;
    const bool halting =
        motion_ == Motion::kHalt && profile && enabled && (look.status & kStatusTargetReached) == 0;
    reading.moving = halting || std::abs(velocity) > options_.standstill_dps;
    if (reading.moving) reading.velocity_dps = velocity;
  }
  if (reading.moving && reading.velocity_dps == 0) {
    ASSIGN_OR_RETURN(reading.velocity_dps, ReadVelocity());
  }
  reading.homed = homed_;
  return reading;
}

absl::StatusOr<bool> CanopenAxisLink::HomingMoves(uint16_t status) {
  const HomingState state = DecodeHoming(status);
  // What stood there from an earlier homing is not to be taken for this one's end.
  const bool this_one =
      homing_seen_ || node_.clock().Now() - homing_since_ > options_.setpoint_time;
  switch (state) {
    case HomingState::kRunning:
    case HomingState::kAttained:
    case HomingState::kErrorMoving:
      homing_seen_ = true;
      return true;
    case HomingState::kDone:
      if (!this_one) return true;
      homed_ = true;
      motion_ = Motion::kNone;
      return false;
    case HomingState::kNotStarted:
    case HomingState::kError:
    case HomingState::kReserved:
      if (!this_one) return true;
      motion_ = Motion::kNone;
      return node_.Fault(absl::StatusCode::kFailedPrecondition, "HOMING_FAILED",
                         absl::StrFormat("could not be homed: %s (statusword %04Xh)",
                                         AbslView(HomingStateName(state)), status));
  }
  return false;
}

// ---- What it is told

absl::Status CanopenAxisLink::Control(uint16_t word) {
  RETURN_IF_ERROR(node_.WriteInteger(kControlword, word, 2));
  control_ = word;
  return absl::OkStatus();
}

absl::StatusOr<bool> CanopenAxisLink::AwaitStatus(uint16_t mask, uint16_t value,
                                                  Duration patience) {
  const TimePoint deadline = node_.clock().Now() + patience;
  while (true) {
    ASSIGN_OR_RETURN(const uint16_t status, ReadStatus());
    if ((status & mask) == value) return true;
    if (node_.clock().Now() > deadline) return false;
    SleepFor(node_.clock(), kLook);
  }
}

absl::Status CanopenAxisLink::SetMode(int8_t mode) {
  if (mode_ == mode) return absl::OkStatus();
  mode_ = 0;
  RETURN_IF_ERROR(node_.WriteInteger(kMode, mode, 1));
  const TimePoint deadline = node_.clock().Now() + options_.enable_time;
  while (true) {
    ASSIGN_OR_RETURN(const int32_t shown, node_.ReadSigned(kModeDisplay));
    if (shown == mode) break;
    if (node_.clock().Now() > deadline) {
      return node_.Fault(
          absl::StatusCode::kFailedPrecondition, "DEVICE_FAULT",
          absl::StrFormat("stays in mode of operation %d instead of %d", shown, mode));
    }
    SleepFor(node_.clock(), kLook);
  }
  mode_ = mode;
  return absl::OkStatus();
}

absl::Status CanopenAxisLink::Enable() {
  std::optional<DriveState> before;
  TimePoint since{};
  while (true) {
    ASSIGN_OR_RETURN(const DriveState state, ReadState());
    if (state == DriveState::kOperationEnabled) return absl::OkStatus();
    if (state == DriveState::kFault) return DriveFault(state);
    const TimePoint now = node_.clock().Now();
    if (state != before) {
      before = state;
      since = now;
      if (const auto word = StepToOperationEnabled(state)) RETURN_IF_ERROR(Control(*word));
    } else if (now - since > options_.enable_time) {
      ASSIGN_OR_RETURN(const uint16_t status, ReadStatus());
      const char* remote = (status & kStatusRemote) != 0
                               ? "are power and enable input on?"
                               : "it is not under the bus's control (statusword bit 9)";
      return node_.Fault(absl::StatusCode::kFailedPrecondition, "DEVICE_FAULT",
                         absl::StrFormat("stays in the state %s (statusword %04Xh): %s",
                                         AbslView(DriveStateName(state)), status, remote));
    }
    SleepFor(node_.clock(), kLook);
  }
}

absl::Status CanopenAxisLink::ResetFault() {
  ASSIGN_OR_RETURN(const DriveState state, ReadState());
  if (state != DriveState::kFault && state != DriveState::kFaultReaction) return absl::OkStatus();
  ASSIGN_OR_RETURN(const bool came_to_rest, AwaitStatus(0x4F, 0x08, options_.enable_time));
  if (!came_to_rest) return DriveFault(state);
  // Bit 7 counts when it rises.
  RETURN_IF_ERROR(Control(kControlDisableVoltage));
  RETURN_IF_ERROR(Control(kControlFaultReset));
  ASSIGN_OR_RETURN(const bool reset, AwaitStatus(0x08, 0x00, options_.enable_time));
  if (!reset) return DriveFault(DriveState::kFault);
  return Control(kControlDisableVoltage);
}

absl::Status CanopenAxisLink::StartHome() {
  RETURN_IF_ERROR(node_.Check());
  homed_ = false;
  motion_ = Motion::kNone;
  RETURN_IF_ERROR(ResetFault());
  RETURN_IF_ERROR(SetMode(kModeHoming));
  RETURN_IF_ERROR(node_.WriteInteger(kHomingMethod, options_.homing_method, 1));
  auto velocity = [&](double dps) {
    return static_cast<int64_t>(
        std::clamp<double>(PerTurn(dps, options_.velocity_units), 1, UINT32_MAX));
  };
  RETURN_IF_ERROR(node_.WriteInteger(kHomingFast, velocity(options_.homing_velocity_dps), 4));
  RETURN_IF_ERROR(node_.WriteInteger(kHomingSlow, velocity(options_.homing_slow_velocity_dps), 4));
  const double ramp = PerTurn(options_.max_acceleration_dps2, options_.acceleration_units);
  RETURN_IF_ERROR(node_
                      .WriteOptional(kHomingAcceleration,
                                     static_cast<int64_t>(std::clamp<double>(ramp, 1, UINT32_MAX)),
                                     4)
                      .status());
  RETURN_IF_ERROR(Enable());
  // Bit 4 counts when it rises. A halt is lifted here: in homing mode nothing is left that would go on.
  RETURN_IF_ERROR(Control(kControlEnable));
  homing_seen_ = false;
  homing_since_ = node_.clock().Now();
  RETURN_IF_ERROR(Control(kControlEnable | kControlStartHoming));
  motion_ = Motion::kHoming;
  return absl::OkStatus();
}

absl::Status CanopenAxisLink::Prepare(int8_t mode) {
  // The start bit of homing is no set-point.
  if ((control_ & kControlNewSetpoint) != 0) {
    RETURN_IF_ERROR(Control(control_ & static_cast<uint16_t>(~kControlNewSetpoint)));
  }
  RETURN_IF_ERROR(SetMode(mode));
  return Enable();
}

absl::StatusOr<bool> CanopenAxisLink::OfferSetpoint() {
  // A halt stays until the new set-point is there: lifting it alone would let the drive go on to the old one.
  RETURN_IF_ERROR(Control(kControlEnable | (control_ & kControlHalt)));
  ASSIGN_OR_RETURN(const bool ready,
                   AwaitStatus(kStatusSetpointAcknowledged, 0, options_.setpoint_time));
  if (!ready) return false;
  RETURN_IF_ERROR(Control(kControlEnable | kControlNewSetpoint | kControlAtOnce));
  return AwaitStatus(kStatusSetpointAcknowledged, kStatusSetpointAcknowledged,
                     options_.setpoint_time);
}

absl::Status CanopenAxisLink::StartMove(Angle target, double velocity_dps) {
  RETURN_IF_ERROR(node_.Check());
  const double units = std::round(ToUnits(target));
  const double low = drive_limits_.has_value() ? drive_limits_->first : INT32_MIN;
  const double high = drive_limits_.has_value() ? drive_limits_->second : INT32_MAX;
  if (!(units >= low && units <= high)) {
    return node_.Fault(
        absl::StatusCode::kOutOfRange, "AXIS_LIMIT",
        absl::StrFormat("can not go to %g deg: that is position %.0f, and it counts from %.0f to "
                        "%.0f; home it to begin anew",
                        target.degrees(), units, low, high));
  }
  RETURN_IF_ERROR(Prepare(kModeProfilePosition));
  RETURN_IF_ERROR(node_.WriteInteger(kTarget, static_cast<int64_t>(units), 4));
  const double velocity = PerTurn(velocity_dps, options_.velocity_units);
  RETURN_IF_ERROR(node_.WriteInteger(
      kProfileVelocity, static_cast<int64_t>(std::clamp<double>(velocity, 1, UINT32_MAX)), 4));
  for (int attempt = 1;; ++attempt) {
    ASSIGN_OR_RETURN(const bool taken, OfferSetpoint());
    if (taken) break;
    if (attempt < 2) {
      spdlog::warn("{} did not acknowledge the set-point; offered once more", node_.Where());
      continue;
    }
    // It may have taken it for all that.
    Halt().IgnoreError();
    return node_.Fault(
        absl::StatusCode::kFailedPrecondition, "SETPOINT_NOT_ACKNOWLEDGED",
        absl::StrFormat("did not acknowledge the set-point of %g deg twice, within %g ms each "
                        "(statusword bit 12)",
                        target.degrees(), Seconds(options_.setpoint_time) * 1e3));
  }
  RETURN_IF_ERROR(Control(kControlEnable));
  motion_ = Motion::kMove;
  return absl::OkStatus();
}

absl::Status CanopenAxisLink::StartTurn(double velocity_dps, Duration longest) {
  RETURN_IF_ERROR(node_.Check());
  if (!brakes_alone_) {
    return node_.Fault(absl::StatusCode::kUnimplemented, "CANNOT_TURN",
                       "would turn for ever if this daemon dies: it has no consumer heartbeat "
                       "(1016h) or no abort connection option code (6007h)");
  }
  ASSIGN_OR_RETURN(const std::optional<uint32_t> modes, node_.ReadOptional(kSupportedModes));
  if (modes.has_value() && (*modes >> (kModeProfileVelocity - 1) & 1) == 0) {
    return node_.Fault(absl::StatusCode::kUnimplemented, "CANNOT_TURN",
                       absl::StrFormat("has no profile velocity mode (6502h: %08Xh)", *modes));
  }
  const double exact = std::abs(velocity_dps) / 360 * options_.velocity_units;
  if (std::abs(std::round(exact) - exact) > 0.1 * exact || exact > INT32_MAX) {
    return node_.Fault(
        absl::StatusCode::kOutOfRange, "AXIS_VELOCITY",
        absl::StrFormat("can not turn at %g deg/s: that is %g velocity units (60FFh)", velocity_dps,
                        exact));
  }
  const double velocity = std::copysign(std::round(exact), velocity_dps * options_.units_per_turn);
  // Its position would begin anew at the other end, and nobody would know.
  ASSIGN_OR_RETURN(const int32_t from, node_.ReadSigned(kPosition));
  const double to = from + velocity_dps * Seconds(longest) / 360 * options_.units_per_turn;
  if (!(to >= INT32_MIN && to <= INT32_MAX)) {
    return node_.Fault(
        absl::StatusCode::kOutOfRange, "AXIS_LIMIT",
        absl::StrFormat(
            "can not turn at %g deg/s for %g s: it would come to position %.0f, and it "
            "counts from %d to %d; turn it for a shorter time, or home it to begin anew",
            velocity_dps, Seconds(longest), to, INT32_MIN, INT32_MAX));
  }
  // What the last turn left in it is not to be turned at when the mode changes.
  RETURN_IF_ERROR(node_.WriteInteger(kTargetVelocity, static_cast<int64_t>(velocity), 4));
  RETURN_IF_ERROR(Prepare(kModeProfileVelocity));
  RETURN_IF_ERROR(Control(kControlEnable));  // lifts a halt
  motion_ = Motion::kTurn;
  return absl::OkStatus();
}

absl::Status CanopenAxisLink::Halt() {
  absl::StatusOr<DriveState> state = ReadState();
  motion_ = Motion::kHalt;
  if (!state.ok()) {
    // Quick stop is the one command that never gives it power, whatever its state.
    const uint8_t quick_stop[] = {kControlQuickStop, 0};
    node_.bus()
        .Send(MakeFrame(static_cast<uint16_t>(kSdoClient + node_.id()),
                        EncodeDownload(kControlword, quick_stop)))
        .IgnoreError();
    return state.status();
  }
  // In all other states it has no power, or brakes already.
  if (*state != DriveState::kOperationEnabled) return absl::OkStatus();
  return Control(options_.stop_by_quick_stop ? kControlQuickStop : (kControlEnable | kControlHalt));
}

}  // namespace lightstage::canopen
