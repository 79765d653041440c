#include "sim/peers/modbus/lamps_peer.h"

#include <algorithm>
#include <utility>

namespace lightstage::sim {
namespace {

constexpr int kIllegalFunction = 1, kIllegalAddress = 2;

}  // namespace

ModbusLampsPeer::ModbusLampsPeer(const LampsPeerOptions& options, std::shared_ptr<World> world)
    : o_(options), world_(std::move(world)) {
  MutexLock lock(&mutex_);
  values_.assign(o_.lamps, DarkValue());
  read_ = values_;
}

ModbusAnswer ModbusLampsPeer::Handle(const ModbusRequest& request) {
  MutexLock lock(&mutex_);
  const bool coils = request.function == 1 || request.function == 5 || request.function == 15;
  const bool reads = !request.writes();
  if (!coils && o_.watchdog >= 0 && request.address == o_.watchdog && request.count == 1) {
    if (reads) return {0, {watchdog_}};
    watchdog_ = request.values[0];
    RestartLocked();
    return {};
  }
  if (coils != (o_.full == 0)) return {kIllegalFunction, {}};
  if (o_.single_writes && request.function >= 15) return {kIllegalFunction, {}};
  const int first = request.address - o_.first_address;
  if (first < 0 || first + request.count > o_.lamps) return {kIllegalAddress, {}};
  if (reads) {
    if (world_->clock().Now() >= read_at_) read_ = values_;
    return {0, {read_.begin() + first, read_.begin() + first + request.count}};
  }
  for (int i = 0; i < request.count; ++i) {
    if (stuck_ != o_.first_lamp + first + i) values_[first + i] = request.values[i];
  }
  read_at_ = world_->clock().Now() + late_;
  ShineLocked();
  return {};
}

void ModbusLampsPeer::ShineLocked() {
  const TimePoint now = world_->clock().Now();
  std::vector<float> levels = world_->LampLevels(now);
  for (int i = 0; i < o_.lamps; ++i) {
    levels[o_.first_lamp + i] =
        o_.full > 0 ? std::min(1.0f, static_cast<float>(values_[i]) / static_cast<float>(o_.full))
                    : static_cast<float>((values_[i] != 0) != o_.inverted);
  }
  world_->RampLamps(now, {}, {}, levels);
}

void ModbusLampsPeer::RestartLocked() {
  dark_at_ = watchdog_ == 0 ? kNever : world_->clock().Now() + o_.watchdog_step * watchdog_;
}

void ModbusLampsPeer::Tick() {
  MutexLock lock(&mutex_);
  if (world_->clock().Now() < dark_at_) return;
  dark_at_ = kNever;
  std::fill(values_.begin(), values_.end(), DarkValue());
  ShineLocked();
}

void ModbusLampsPeer::PowerCycle() {
  MutexLock lock(&mutex_);
  watchdog_ = 0;
  dark_at_ = kNever;
  std::fill(values_.begin(), values_.end(), DarkValue());
  ShineLocked();
}

void ModbusLampsPeer::Stick(std::optional<int> lamp) {
  MutexLock lock(&mutex_);
  stuck_ = lamp;
}

void ModbusLampsPeer::ReadBackLate(Duration late) {
  MutexLock lock(&mutex_);
  late_ = late;
}

}  // namespace lightstage::sim
