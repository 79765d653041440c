#include "sim/peers/modbus/drive_peer.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/status.h"
#include "sim/peers/modbus/drive_maps.h"

namespace lightstage::sim {
namespace {

constexpr int kIllegalFunction = 1, kIllegalAddress = 2, kDeviceFailure = 4;
// A drive looks for its reference for a while even if it is there.
constexpr Duration kLeastHoming = std::chrono::milliseconds(60);
// So far its count is from the axis' angle before it is homed, steps.
constexpr int64_t kUnhomedOffset = 777;

}  // namespace

bool ModbusDrivePeer::Knows(const std::string& kind) {
  return std::any_of(DriveMaps().begin(), DriveMaps().end(),
                     [&](const DriveMap& map) { return map.kind == kind; });
}

absl::StatusOr<std::shared_ptr<ModbusDrivePeer>> ModbusDrivePeer::Create(
    const DrivePeerOptions& options, std::shared_ptr<World> world) {
  for (const DriveMap& map : DriveMaps()) {
    if (map.kind == options.kind) {
      return std::shared_ptr<ModbusDrivePeer>(new ModbusDrivePeer(options, map, std::move(world)));
    }
  }
  return Error(absl::StatusCode::kInvalidArgument, "PEER_NOT_STARTED",
               absl::StrCat("there is no drive of the kind ", options.kind));
}

ModbusDrivePeer::ModbusDrivePeer(const DrivePeerOptions& options, const DriveMap& map,
                                 std::shared_ptr<World> world)
    : o_(options), map_(map), world_(std::move(world)) {
  MutexLock lock(&mutex_);
  offset_ = kUnhomedOffset;
  enabled_ = map_.enabled_at_start;
  serial_ = options.serial;
  for (const auto& [first, last] : map_.writable) {
    for (int address = first; address <= last; ++address) written_[address] = 0;
  }
}

ModbusAnswer ModbusDrivePeer::Handle(const ModbusRequest& request) {
  MutexLock lock(&mutex_);
  UpdateLocked();
  ModbusAnswer answer;
  switch (request.function) {
    case 3:
    case 4:
      for (int i = 0; i < request.count; ++i) {
        const std::optional<uint16_t> value = GetLocked(request.address + i);
        if (!value) return {kIllegalAddress, {}};
        answer.values.push_back(*value);
      }
      return answer;
    case 6:
    case 16:
      break;
    default:
      return {kIllegalFunction, {}};
  }
  for (int i = 0; i < request.count; ++i) {
    if (written_.count(request.address + i) == 0) return {kIllegalAddress, {}};
  }
  const std::map<int, uint16_t> before = written_;
  for (int i = 0; i < request.count; ++i) written_[request.address + i] = request.values[i];
  if (deaf_) return answer;
  for (const DriveTrigger& trigger : map_.triggers) {
    const int i = trigger.address - request.address;
    if (i < 0 || i >= request.count || request.values[i] != trigger.value) continue;
    if (map_.on_edge && trigger.action != DriveAction::kMove &&
        before.at(trigger.address) == trigger.value) {
      continue;
    }
    for (const auto& [address, value] : trigger.needs) {
      if (written_.at(address) != value) return {kDeviceFailure, {}};
    }
    answer.exception = ActLocked(trigger.action);
  }
  return answer;
}

std::optional<uint16_t> ModbusDrivePeer::GetLocked(int address) {
  auto word = [](uint32_t value, bool high) {
    return static_cast<uint16_t>(high ? value >> 16 : value);
  };
  if (address == map_.position || address == map_.position + 1) {
    const bool first = address == map_.position;
    return word(static_cast<uint32_t>(PositionLocked()),
                first != (map_.low_first != swap_position_));
  }
  if (address == map_.status) return StatusLocked();
  if (address >= map_.fault && address < map_.fault + map_.fault_words) {
    const bool last = address == map_.fault + map_.fault_words - 1;
    return word(fault_, map_.fault_words == 2 && last == map_.low_first);
  }
  if (map_.serial >= 0 && (address == map_.serial || address == map_.serial + 1)) {
    return word(serial_, (address == map_.serial) != map_.low_first);
  }
  if (std::find(map_.zeros.begin(), map_.zeros.end(), address) != map_.zeros.end()) return 0;
  const auto written = written_.find(address);
  if (written != written_.end()) return written->second;
  return std::nullopt;
}

int ModbusDrivePeer::ActLocked(DriveAction action) {
  switch (action) {
    case DriveAction::kMove:
      ++moves_;
      return fault_ != 0 || !enabled_ || MovingLocked() ? kDeviceFailure : MoveLocked();
    case DriveAction::kHome:
      ++homings_;
      if (fault_ != 0 || !enabled_ || MovingLocked()) return kDeviceFailure;
      HomeLocked();
      return 0;
    case DriveAction::kHalt:
      ++halts_;
      BrakeLocked();
      return 0;
    case DriveAction::kClear:
      if (!for_good_) fault_ = 0;
      return 0;
    case DriveAction::kEnable:
      if (fault_ != 0) return kDeviceFailure;
      enabled_ = true;
      return 0;
    case DriveAction::kZero:
      offset_ = 0;
      offset_ = -PositionLocked();
      return 0;
  }
  return kDeviceFailure;
}

int64_t ModbusDrivePeer::WrittenLocked(int address, int words, bool is_signed) {
  const uint32_t first = written_.at(address);
  if (words == 1) return first;
  const uint32_t second = written_.at(address + 1);
  const uint32_t value =
      map_.low_first != swap_commands_ ? second << 16 | first : first << 16 | second;
  return is_signed ? int64_t{static_cast<int32_t>(value)} : int64_t{value};
}

int ModbusDrivePeer::MoveLocked() {
  const int64_t target = WrittenLocked(map_.target, 2, true);
  const auto velocity =
      static_cast<double>(WrittenLocked(map_.velocity, map_.velocity_words, false));
  const auto acceleration =
      static_cast<double>(WrittenLocked(map_.acceleration, map_.acceleration_words, false));
  if (velocity <= 0 || acceleration <= 0) return kDeviceFailure;
  AxisMechanics mechanics;
  mechanics.max_acceleration_dps2 =
      std::min(map_.steps_per_s2(acceleration, o_.steps_per_rev) / o_.steps_per_degree,
               o_.max_acceleration_dps2);
  const double dps = std::min(map_.steps_per_s(velocity, o_.steps_per_rev) / o_.steps_per_degree,
                              o_.max_velocity_dps);
  const TimePoint now = world_->clock().Now();
  const double from = world_->AxisAt(o_.role, now).position.degrees();
  const double to = static_cast<double>(target - offset_) / o_.steps_per_degree;
  if (map_.move_clears_homed) homed_ = false;
  if (to != from) world_->SetMotion(o_.role, Travel(now, from, to - from, to, dps, mechanics));
  return 0;
}

void ModbusDrivePeer::HomeLocked() {
  const TimePoint now = world_->clock().Now();
  const double from = world_->AxisAt(o_.role, now).position.degrees();
  if (from != 0) {
    AxisMechanics mechanics;
    mechanics.max_acceleration_dps2 = o_.max_acceleration_dps2;
    world_->SetMotion(o_.role, Travel(now, from, -from, 0, o_.max_velocity_dps / 4, mechanics));
  }
  homed_ = false;
  homing_ = true;
  busy_until_ = now + kLeastHoming;
}

void ModbusDrivePeer::BrakeLocked() {
  const TimePoint now = world_->clock().Now();
  homing_ = false;
  busy_until_ = now;
  const AxisState state = world_->AxisAt(o_.role, now);
  if (!state.moving) return;
  AxisMechanics mechanics;
  mechanics.max_acceleration_dps2 = o_.max_acceleration_dps2;
  world_->SetMotion(o_.role, Brake(now, state.position.degrees(), state.velocity_dps, mechanics));
}

bool ModbusDrivePeer::MovingLocked() {
  const TimePoint now = world_->clock().Now();
  return now < busy_until_ || world_->AxisAt(o_.role, now).moving;
}

// Homing ends when the axis stands at its reference.
void ModbusDrivePeer::UpdateLocked() {
  if (!homing_ || MovingLocked()) return;
  homing_ = false;
  homed_ = true;
  if (map_.home_zeroes) offset_ = 0;
}

int64_t ModbusDrivePeer::PositionLocked() {
  if (frozen_) return *frozen_;
  const double degrees = world_->AxisAt(o_.role, world_->clock().Now()).position.degrees() * scale_;
  return std::llround(degrees * o_.steps_per_degree) + offset_;
}

uint16_t ModbusDrivePeer::StatusLocked() {
  const bool moving = MovingLocked();
  unsigned status = moving ? map_.moving : map_.standing;
  if (!moving && fault_ == 0) status |= map_.in_position;
  if (fault_ != 0) status |= map_.faulty;
  if (homed_) status |= map_.homed;
  if (homing_) status |= map_.homing;
  if (enabled_) status |= map_.enabled;
  return static_cast<uint16_t>(status);
}

void ModbusDrivePeer::Fail(uint32_t code) {
  MutexLock lock(&mutex_);
  fault_ = code;
  enabled_ = map_.enabled_at_start;
  BrakeLocked();
}
void ModbusDrivePeer::FailForGood(bool fails) {
  MutexLock lock(&mutex_);
  for_good_ = fails;
}
void ModbusDrivePeer::Freeze(bool frozen) {
  MutexLock lock(&mutex_);
  if (!frozen) {
    frozen_.reset();
  } else {
    frozen_ = PositionLocked();
  }
}
void ModbusDrivePeer::BeDeaf(bool deaf) {
  MutexLock lock(&mutex_);
  deaf_ = deaf;
}
void ModbusDrivePeer::SwapWords(bool position, bool commands) {
  MutexLock lock(&mutex_);
  swap_position_ = position;
  swap_commands_ = commands;
}
void ModbusDrivePeer::Scale(double factor) {
  MutexLock lock(&mutex_);
  scale_ = factor;
}
void ModbusDrivePeer::SetSerial(uint32_t serial) {
  MutexLock lock(&mutex_);
  serial_ = serial;
}
void ModbusDrivePeer::PowerCycle() {
  MutexLock lock(&mutex_);
  BrakeLocked();
  homed_ = false;
  enabled_ = map_.enabled_at_start;
  fault_ = 0;
  offset_ = kUnhomedOffset;
}

int ModbusDrivePeer::moves() const {
  MutexLock lock(&mutex_);
  return moves_;
}
int ModbusDrivePeer::homings() const {
  MutexLock lock(&mutex_);
  return homings_;
}
int ModbusDrivePeer::halts() const {
  MutexLock lock(&mutex_);
  return halts_;
}

}  // namespace lightstage::sim
