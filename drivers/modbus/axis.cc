#include "drivers/modbus/axis.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "absl/strings/str_format.h"
#include "drivers/link/axis_link.h"
#include "drivers/modbus/client.h"

namespace lightstage {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

// So long after its command a drive may still say that it stands.
constexpr Duration kStartGrace = milliseconds(500);
// So long it may take to come to rest when the link is opened, and to drop a fault that is cleared.
constexpr Duration kRestPatience = seconds(5), kClearPatience = seconds(1);
// What the plausibility move may take beyond its calculated time.
constexpr Duration kProbePatience = seconds(2);

class ModbusDrive final : public AxisLink {
 public:
  ModbusDrive(const ModbusAxisOptions& options, const DeviceContext& context)
      : o_(options),
        profile_(o_.profile),
        name_(context.name),
        clock_(*context.clock),
        client_(options.line, options.unit, context.name, *context.clock) {}

  absl::Status Connect() override {
    RETURN_IF_ERROR(client_.Connect());
    phase_ = Phase::kIdle;
    referenced_ = plausible_ = false;
    last_.reset();
    RETURN_IF_ERROR(CheckSerial());
    ASSIGN_OR_RETURN(Raw raw, ReadRaw());
    if (Moving(raw)) {
      spdlog::warn("{}: moves while it is opened, and is stopped", name_);
      RETURN_IF_ERROR(Write(profile_.halt, {}));
      RETURN_IF_ERROR(
          Await(kRestPatience, "to come to rest", [this](const Raw& now) { return !Moving(now); }));
    }
    // A drive with a fault may refuse to be enabled; homing clears the fault and enables it.
    if (Faulty(raw)) return absl::OkStatus();
    return Write(profile_.start, {});
  }

  AxisInfo info() const override {
    AxisInfo info;
    info.identity.model = profile_.model;
    if (serial_) info.identity.serial = absl::StrCat(*serial_);
    info.min = o_.min;
    info.max = o_.max;
    info.continuous = o_.continuous;
    info.max_velocity_dps = o_.max_velocity_dps;
    info.max_acceleration_dps2 = o_.max_acceleration_dps2;
    info.settle = o_.settle;
    info.tolerance = o_.tolerance;
    return info;
  }

  absl::StatusOr<AxisReading> Read() override {
    ASSIGN_OR_RETURN(const Raw raw, ReadRaw());
    if (Faulty(raw)) {
      phase_ = Phase::kIdle;
      referenced_ = false;
      return FaultError();
    }
    AxisReading reading;
    reading.position = AngleOf(raw.position);
    switch (phase_) {
      case Phase::kIdle:
        reading.moving = Moving(raw);
        break;
      case Phase::kHoming: {
        ASSIGN_OR_RETURN(reading.moving, GoOnHoming(raw));
        break;
      }
      case Phase::kProbeOut:
      case Phase::kProbeBack: {
        ASSIGN_OR_RETURN(reading.moving, GoOnProbing(raw));
        break;
      }
    }
    reading.homed = Homed(raw);
    const TimePoint now = clock_.Now();
    if (reading.moving && last_ && now > last_->first) {
      reading.velocity_dps =
          (reading.position - last_->second).degrees() / Seconds(now - last_->first);
    }
    last_.emplace(now, reading.position);
    return reading;
  }

  absl::Status StartHome() override {
    phase_ = Phase::kIdle;
    referenced_ = plausible_ = false;
    ASSIGN_OR_RETURN(const Raw raw, ReadRaw());
    if (Faulty(raw)) {
      absl::Status fault = FaultError();
      spdlog::warn("{}: clearing the fault: {}", name_, MessageOf(fault));
      RETURN_IF_ERROR(Write(profile_.clear_fault, {}));
      absl::Status cleared = Await(kClearPatience, "to drop its fault",
                                   [this](const Raw& now) { return !Faulty(now); });
      if (ErrorReason(cleared) == "DEVICE_FAULT") return fault;
      RETURN_IF_ERROR(cleared);
    }
    RETURN_IF_ERROR(Write(profile_.start, {}));
    RETURN_IF_ERROR(Command(profile_.home, {}));
    phase_ = Phase::kHoming;
    homing_seen_ = false;
    since_ = clock_.Now();
    return absl::OkStatus();
  }

  absl::Status StartMove(Angle target, double velocity_dps) override {
    return Go(StepsOf(target), velocity_dps, target);
  }

  absl::Status StartTurn(double velocity_dps, Duration longest) override {
    // What profiles describe are drives that are positioned: as far as it goes in that time, where it stops by itself.
    ASSIGN_OR_RETURN(const Raw raw, ReadRaw());
    return StartMove(AngleOf(raw.position) + Degrees(velocity_dps * Seconds(longest)),
                     std::abs(velocity_dps));
  }

  absl::Status Halt() override {
    phase_ = Phase::kIdle;
    absl::Status halted;
    // A stop that is not answered is told again; any other command is better told by whoever wants it.
    for (int attempt = 0; attempt < 2; ++attempt) {
      halted = Write(profile_.halt, {});
      if (!absl::IsDeadlineExceeded(halted)) break;
    }
    return halted;
  }

 private:
  enum class Phase { kIdle, kHoming, kProbeOut, kProbeBack };
  struct Raw {
    int64_t position = 0;
    uint32_t status = 0;
  };

  // ---- Units

  double Sign() const { return o_.reverse ? -1 : 1; }
  Angle AngleOf(int64_t steps) const {
    return o_.zero + Degrees(Sign() * static_cast<double>(steps) / o_.steps_per_degree);
  }
  // In steps, which may be too many for the drive's registers.
  double StepsOf(Angle angle) const {
    return std::round(Sign() * (angle - o_.zero).degrees() * o_.steps_per_degree);
  }

  // ---- What the drive says

  bool Moving(const Raw& raw) const {
    const StatusBits& bits = profile_.status;
    if (bits.moving != 0 && (raw.status & bits.moving) != 0) return true;
    if (bits.standing != 0 && (raw.status & bits.standing) != bits.standing) return true;
    if ((raw.status & bits.homing) != 0) return true;
    // Not yet where its regulator wants it. A drive with a fault is not held there.
    return (raw.status & bits.in_position) != bits.in_position && !Faulty(raw);
  }
  bool Faulty(const Raw& raw) const { return (raw.status & profile_.status.fault) != 0; }
  bool HomedBits(const Raw& raw) const {
    return (raw.status & profile_.status.homed) == profile_.status.homed;
  }
  bool Homed(const Raw& raw) const {
    if (phase_ != Phase::kIdle) return false;
    if (o_.plausibility_move > Degrees(0) && !plausible_) return false;
    return profile_.status.homed_live ? HomedBits(raw) : referenced_;
  }

  absl::StatusOr<int64_t> ReadNumber(const NumberRegister& number) {
    ASSIGN_OR_RETURN(const std::vector<uint16_t> words,
                     client_.ReadRegisters(number.address, number.format.words, number.input));
    const std::optional<int64_t> value = DecodeNumber(number.format, words);
    if (!value) {
      return Error(absl::StatusCode::kInternal, "MODBUS_REQUEST",
                   absl::StrCat(name_, ": the number at ", number.address, " has no value"));
    }
    return *value;
  }

  absl::StatusOr<Raw> ReadRaw() {
    Raw raw;
    // The status first: if it says that the axis stands, the position is where it stands.
    ASSIGN_OR_RETURN(const int64_t status, ReadNumber(profile_.status.value));
    raw.status = static_cast<uint32_t>(status);
    ASSIGN_OR_RETURN(raw.position, ReadNumber(profile_.position));
    return raw;
  }

  absl::Status CheckSerial() {
    if (!profile_.serial) return absl::OkStatus();
    ASSIGN_OR_RETURN(const int64_t serial, ReadNumber(*profile_.serial));
    if (serial_ && *serial_ != serial) {
      return Error(
          absl::StatusCode::kFailedPrecondition, "DEVICE_UNSUITABLE",
          absl::StrCat(name_, ": serial number ", serial, " answers where ", *serial_, " was"),
          {{"device", name_}, {"serial", absl::StrCat(serial)}});
    }
    serial_ = serial;
    return absl::OkStatus();
  }

  absl::Status FaultError() {
    std::string code = "without a code";
    ErrorMetadata metadata = {{"device", name_}};
    if (profile_.fault_code) {
      ASSIGN_OR_RETURN(const int64_t value, ReadNumber(*profile_.fault_code));
      const auto known = profile_.fault_names.find(value);
      code = absl::StrFormat(
          "0x%X (%s)", value,
          known != profile_.fault_names.end() ? known->second : "see the drive's manual");
      metadata.emplace_back("fault", absl::StrFormat("0x%X", value));
    }
    return Error(absl::StatusCode::kFailedPrecondition, "DEVICE_FAULT",
                 absl::StrCat(name_, ": the drive has fault ", code,
                              "; see to its cause, then home the axis"),
                 metadata);
  }

  template <class Condition>
  absl::Status Await(Duration patience, const char* what, Condition condition) {
    const TimePoint give_up = clock_.Now() + patience;
    while (true) {
      ASSIGN_OR_RETURN(const Raw raw, ReadRaw());
      if (condition(raw)) return absl::OkStatus();
      if (clock_.Now() >= give_up) {
        if (Faulty(raw)) return FaultError();
        return Error(absl::StatusCode::kDeadlineExceeded, "DEVICE_SILENT",
                     absl::StrFormat("%s: the drive was told %s and has not in %g s", name_, what,
                                     Seconds(patience)),
                     {{"device", name_}});
      }
      SleepFor(clock_, o_.poll);
    }
  }

  // ---- What it is told

  absl::Status Write(const std::vector<WriteStep>& steps, const MoveValues& values) {
    for (const WriteStep& step : steps) {
      const std::optional<std::vector<uint16_t>> words = EncodeStep(profile_, step, values);
      if (!words) {
        return Error(absl::StatusCode::kInternal, "MODBUS_REQUEST",
                     absl::StrCat(name_, ": a value does not fit into its register"));
      }
      RETURN_IF_ERROR(step.single ? client_.WriteRegister(step.address, words->front())
                                  : client_.WriteRegisters(step.address, *words));
      if (step.wait > Duration::zero()) SleepFor(clock_, step.wait);
    }
    return absl::OkStatus();
  }

  // As Write, for what moves the axis: if it is not known what has arrived, the axis is stopped.
  absl::Status Command(const std::vector<WriteStep>& steps, const MoveValues& values) {
    absl::Status written = Write(steps, values);
    if (!written.ok() && ErrorReason(written) != "DEVICE_LOST") {
      if (absl::Status halted = Halt(); !halted.ok()) {
        spdlog::error("{}: may be moving: {}", name_, MessageOf(halted));
      }
    }
    return written;
  }

  // The positions that it can count and be told.
  int64_t First() const {
    return std::max(Lowest(profile_.target), Lowest(profile_.position.format));
  }
  int64_t Last() const {
    return std::min(Highest(profile_.target), Highest(profile_.position.format));
  }

  absl::Status Go(double steps, double velocity_dps, Angle target) {
    const auto lowest = static_cast<double>(First()), highest = static_cast<double>(Last());
    if (!(steps >= lowest && steps <= highest)) {
      return Error(absl::StatusCode::kOutOfRange, "AXIS_OVERFLOW",
                   absl::StrFormat("%s: %g deg is position %.0f, but the drive counts from %.0f to "
                                   "%.0f; home the axis, so that it counts from 0 again",
                                   name_, target.degrees(), steps, lowest, highest),
                   {{"axis", name_}, {"target_deg", absl::StrCat(target.degrees())}});
    }
    const std::optional<int64_t> velocity =
        VelocityValue(profile_, velocity_dps * o_.steps_per_degree, o_.steps_per_rev);
    if (!velocity) {
      return Error(
          absl::StatusCode::kOutOfRange, "AXIS_VELOCITY",
          absl::StrFormat("%s: %g deg/s cannot be told to the drive, whose register takes "
                          "%d to %d",
                          name_, velocity_dps, profile_.velocity.min, profile_.velocity.max),
          {{"axis", name_}, {"velocity_dps", absl::StrCat(velocity_dps)}});
    }
    const std::optional<int64_t> acceleration = AccelerationValue(
        profile_, o_.max_acceleration_dps2 * o_.steps_per_degree, o_.steps_per_rev);
    if (!acceleration) {
      return Error(absl::StatusCode::kOutOfRange, "AXIS_ACCELERATION",
                   absl::StrFormat("%s: %g deg/s2 cannot be told to the drive", name_,
                                   o_.max_acceleration_dps2),
                   {{"axis", name_}});
    }
    return Command(profile_.move, {static_cast<int64_t>(steps), *velocity, *acceleration});
  }

  // ---- Homing, and the move at its end that shows that commands and positions mean what the profile says. Each returns whether it goes on.

  absl::StatusOr<bool> GoOnHoming(const Raw& raw) {
    const bool moving = Moving(raw);
    if (moving || (profile_.status.homed != 0 && !HomedBits(raw))) homing_seen_ = true;
    if (moving) {
      since_ = clock_.Now();
      return true;
    }
    // That it stood all the time is no sign of success.
    if (homing_seen_ && HomedBits(raw)) return EndHoming();
    if (clock_.Now() - since_ < kStartGrace) return true;
    phase_ = Phase::kIdle;
    return false;
  }

  absl::StatusOr<bool> EndHoming() {
    if (!profile_.after_home.empty()) RETURN_IF_ERROR(Write(profile_.after_home, {}));
    referenced_ = true;
    if (o_.plausibility_move <= Degrees(0)) {
      phase_ = Phase::kIdle;
      return false;
    }
    ASSIGN_OR_RETURN(const Raw raw, ReadRaw());
    probe_from_ = AngleOf(raw.position);
    const bool up = o_.continuous || probe_from_ + o_.plausibility_move <= o_.max;
    RETURN_IF_ERROR(
        StartProbe(Phase::kProbeOut, probe_from_ + o_.plausibility_move * (up ? 1 : -1)));
    return true;
  }

  absl::Status StartProbe(Phase phase, Angle goal) {
    // There in about a quarter of a second, if it may go so fast.
    const double velocity =
        std::min(o_.max_velocity_dps, 4 * std::abs(o_.plausibility_move.degrees()));
    AxisInfo mechanics = info();
    mechanics.continuous = true;
    mechanics.settle = {};
    probe_until_ = clock_.Now() + kProbePatience +
                   MoveDuration(mechanics, Degrees(0), o_.plausibility_move, velocity);
    probe_goal_ = goal;
    if (phase == Phase::kProbeOut) probe_asked_ = goal - probe_from_;
    // The register has a slowest velocity; so near that, a few times faster does not matter.
    absl::Status started = Go(StepsOf(goal), velocity, goal);
    if (ErrorReason(started) == "AXIS_VELOCITY") {
      started = Go(StepsOf(goal), o_.max_velocity_dps, goal);
    }
    if (!started.ok()) {
      phase_ = Phase::kIdle;
      return started;
    }
    phase_ = phase;
    since_ = clock_.Now();
    return absl::OkStatus();
  }

  absl::StatusOr<bool> GoOnProbing(const Raw& raw) {
    const Angle at = AngleOf(raw.position);
    const Angle low = std::min(probe_from_, probe_from_ + probe_asked_) - o_.tolerance,
                high = std::max(probe_from_, probe_from_ + probe_asked_) + o_.tolerance;
    // With the words in the wrong order it would go far: not to be waited for.
    if (at < low || at > high) return Implausible(at);
    if (Moving(raw)) {
      if (clock_.Now() > probe_until_) return Implausible(at);
      since_ = clock_.Now();
      return true;
    }
    if (std::abs((at - probe_goal_).degrees()) > o_.tolerance.degrees()) {
      if (clock_.Now() - since_ < kStartGrace) return true;
      return Implausible(at);
    }
    if (phase_ == Phase::kProbeOut) {
      RETURN_IF_ERROR(StartProbe(Phase::kProbeBack, probe_from_));
      return true;
    }
    phase_ = Phase::kIdle;
    plausible_ = true;
    return false;
  }

  absl::Status Implausible(Angle at) {
    const bool back = phase_ == Phase::kProbeBack;
    const Angle began = back ? probe_from_ + probe_asked_ : probe_from_;
    const double asked = (probe_goal_ - began).degrees(), moved = (at - began).degrees();
    if (absl::Status halted = Halt(); !halted.ok()) {
      spdlog::error("{}: may be moving: {}", name_, MessageOf(halted));
    }
    referenced_ = false;
    return Error(
        absl::StatusCode::kFailedPrecondition, "DRIVE_IMPLAUSIBLE",
        absl::StrFormat(
            "%s: told to move by %g deg after homing, its position changed by %g deg; %s", name_,
            asked, moved, ImplausibleHint(asked, moved)),
        {{"axis", name_}, {"asked_deg", absl::StrCat(asked)}, {"moved_deg", absl::StrCat(moved)}});
  }

  const ModbusAxisOptions o_;
  const DriveProfile& profile_;
  const std::string name_;
  Clock& clock_;
  ModbusClient client_;

  std::optional<int64_t> serial_;
  bool referenced_ = false;  // homing has ended well, and nothing since that spoils it
  bool plausible_ = false;   // the same of the plausibility move
  Phase phase_ = Phase::kIdle;
  bool homing_seen_ = false;  // the drive was seen to do something about it
  TimePoint since_{};         // in this phase it was last known to move
  Angle probe_from_, probe_asked_, probe_goal_;
  TimePoint probe_until_{};
  std::optional<std::pair<TimePoint, Angle>> last_;  // position read
};

}  // namespace

std::string ImplausibleHint(double asked, double moved) {
  const double ratio = moved / asked;
  if (std::abs(ratio) > 100) {
    return "the words of the position or the target are likely in the other order (the profile's "
           "order)";
  }
  if (std::abs(ratio) < 1e-3) {
    return "the position read does not follow: it may be another register, or the words in the "
           "other order (the profile's order), or the motor does not turn";
  }
  if (std::abs(ratio + 1) < 0.1) {
    return "commands and positions count in opposite directions: the encoder's direction is set "
           "wrong in the drive";
  }
  return "positions and commands are scaled differently: see to the drive's resolution and "
         "steps_per_degree, and that nothing is in the way";
}

absl::StatusOr<std::unique_ptr<Axis>> OpenModbusAxis(const ModbusAxisOptions& options,
                                                     const DeviceContext& context) {
  return OpenLinkedAxis(context, "modbus", std::make_unique<ModbusDrive>(options, context),
                        options.poll);
}

}  // namespace lightstage
