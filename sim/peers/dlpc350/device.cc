#include "sim/peers/dlpc350/device.h"

#include <algorithm>
#include <utility>

namespace lightstage::sim {
namespace {

// CMD2 · 256 + CMD3.
enum Code {
  kPower = 0x0200,
  kVersion = 0x0205,
  kLedCurrent = 0x0B01,
  kLedPolarity = 0x1A05,
  kLedEnable = 0x1A07,
  kHardware = 0x1A0A,
  kSystem = 0x1A0B,
  kMain = 0x1A0C,
  kValidate = 0x1A1A,
  kMode = 0x1A1B,
  kTriggerOut1 = 0x1A1D,
  kTriggerOut2 = 0x1A1E,
  kSource = 0x1A22,
  kTriggerMode = 0x1A23,
  kStartStop = 0x1A24,
  kExposure = 0x1A29,
  kLutConfig = 0x1A31,
  kMailboxAddress = 0x1A32,
  kMailbox = 0x1A33,
  kMailboxData = 0x1A34,
  kTriggerIn1Delay = 0x1A35,
};

// What can be set and read back, and what it is after power-on.
const std::map<int, std::vector<uint8_t>>& PowerOn() {
  static const std::map<int, std::vector<uint8_t>> kSettings = {
      {kLedCurrent, {0x97, 0x78, 0x7D}},
      {kLedPolarity, {0}},
      {kLedEnable, {8}},
      {kMode, {0}},
      {kTriggerOut1, {0, 0xBB, 0xBB}},
      {kTriggerOut2, {0, 0xBB}},
      {kSource, {0}},
      {kTriggerMode, {0}},
      {kStartStop, {0}},
      {kExposure, {0x46, 0x20, 0, 0, 0x46, 0x20, 0, 0}},
      {kLutConfig, {0, 1, 0, 0}},
      {kMailboxAddress, {0}},
      {kMailbox, {0}},
      {kTriggerIn1Delay, {0, 0, 0, 0}},
  };
  return kSettings;
}

// The guide wants the sequence stopped before these, and a validation after.
bool IsOfSequence(int code) {
  switch (code) {
    case kTriggerOut1:
    case kTriggerOut2:
    case kSource:
    case kTriggerMode:
    case kExposure:
    case kLutConfig:
    case kMailboxData:
    case kTriggerIn1Delay:
      return true;
    default:
      return false;
  }
}

uint32_t Word(const std::vector<uint8_t>& bytes, size_t at) {
  return bytes[at] | bytes[at + 1] << 8 | bytes[at + 2] << 16 | uint32_t{bytes[at + 3]} << 24;
}

}  // namespace

Dlpc350Device::Dlpc350Device(std::shared_ptr<World> world, std::map<FlashPlace, Pattern> flash)
    : world_(std::move(world)), flash_(std::move(flash)) {
  MutexLock lock(&mutex_);
  ResetLocked(false);
}

Dlpc350Device::~Dlpc350Device() {
  if (world_ != nullptr) world_->EndProjector(world_->clock().Now());
}

void Dlpc350Device::ResetLocked(bool standby) {
  settings_ = PowerOn();
  to_come_.clear();
  images_ = {0};
  patterns_ = {0, 0x71, 0x04};
  standby_ = standby;
  validated_ = triggered_ = false;
  message_.clear();
  replies_.clear();
  held_back_.clear();
  LightLocked();
}

void Dlpc350Device::SetSlowness(Duration slow) {
  MutexLock lock(&mutex_);
  slow_ = slow;
}

void Dlpc350Device::ComeIntoForceLocked() {
  const Steady::time_point now = Steady::now();
  for (const auto& [code, change] : to_come_) {
    if (now < change.first) continue;
    if (code == kPower) {
      standby_ = false;
    } else {
      settings_[code] = change.second;
    }
  }
  std::erase_if(to_come_, [&](const auto& change) { return now >= change.second.first; });
  LightLocked();
}

bool Dlpc350Device::Receive(std::span<const uint8_t> report) {
  MutexLock lock(&mutex_);
  if (unplugged_) return false;
  if (report.size() != kReportSize) {
    message_.clear();
    return true;
  }
  message_.insert(message_.end(), report.begin(), report.end());
  const size_t length = message_[2] | static_cast<size_t>(message_[3]) << 8;
  if (message_.size() < 4 + length) return true;  // goes on in the next report
  message_.resize(4 + length);
  for (Bytes& reply : held_back_) replies_.push_back(std::move(reply));
  held_back_.clear();
  ExecuteLocked();
  message_.clear();
  changed_.SignalAll();
  return true;
}

std::optional<std::vector<uint8_t>> Dlpc350Device::Send(Duration patience, bool* unplugged) {
  const auto give_up = std::chrono::steady_clock::now() + patience;
  MutexLock lock(&mutex_);
  while (true) {
    *unplugged = unplugged_;
    if (unplugged_) return std::nullopt;
    if (!replies_.empty()) {
      Bytes report = std::move(replies_.front());
      replies_.pop_front();
      return report;
    }
    const auto left = give_up - std::chrono::steady_clock::now();
    if (left <= left.zero()) return std::nullopt;
    changed_.WaitFor(&mutex_, left);
  }
}

void Dlpc350Device::ExecuteLocked() {
  ComeIntoForceLocked();
  const uint8_t flags = message_[0], sequence = message_[1];
  if (message_.size() < 6) return ReplyLocked(flags | 0x20, sequence, {});
  const int code = message_[5] << 8 | message_[4];
  const Bytes data(message_.begin() + 6, message_.end());
  if (to_come_.contains(kPower)) return;
  if (code == faults_.nack) return ReplyLocked(flags | 0x20, sequence, {});
  if (flags & 0x80) {
    std::optional<Bytes> answer = ReadLocked(code);
    if (!answer) return ReplyLocked(flags | 0x20, sequence, {});
    return ReplyLocked(flags, sequence, *answer);
  }
  const bool taken = code == faults_.ignored || WriteLocked(code, data);
  LightLocked();
  if (to_come_.contains(kPower)) return;
  if (flags & 0x40) ReplyLocked(taken ? flags : flags | 0x20, sequence, {});
}

void Dlpc350Device::ReplyLocked(uint8_t flags, uint8_t sequence, const Bytes& data) {
  if (faults_.silent) return;
  Bytes all = {flags, sequence, static_cast<uint8_t>(data.size()),
               static_cast<uint8_t>(data.size() >> 8)};
  all.insert(all.end(), data.begin(), data.end());
  for (size_t at = 0; at < all.size(); at += kReportSize) {
    Bytes report(all.begin() + static_cast<long>(at),
                 all.begin() + static_cast<long>(std::min(at + kReportSize, all.size())));
    report.resize(faults_.short_reports ? 5 : kReportSize);
    (faults_.late ? held_back_ : replies_).push_back(std::move(report));
  }
}

bool Dlpc350Device::WriteLocked(int code, const Bytes& data) {
  if (code == kPower) {
    if (data.size() != 1 || data[0] > 1) return false;
    if (standby_ && data[0] == 0) {
      ++woken_;
      to_come_[kPower] = {Steady::now() + slow_, {}};
    } else {
      standby_ = data[0] == 1;
    }
    ComeIntoForceLocked();
    return true;
  }
  if (IsOfSequence(code)) {
    if (RunningLocked() && settings_[kMode][0] == 1) return false;
    validated_ = false;
  }
  if (code == kValidate) {
    validated_ = true;
    validation_reads_ = 2;
    return data.size() == 1;
  }
  if (code == kMailboxData) {
    const size_t address = settings_[kMailboxAddress][0];
    const int mailbox = settings_[kMailbox][0];
    Bytes& content = mailbox == 1 ? images_ : patterns_;
    const size_t unit = mailbox == 1 ? 1 : 3;
    if ((mailbox != 1 && mailbox != 2) || data.empty() || data.size() % unit != 0 ||
        address * unit > content.size()) {
      return false;
    }
    content.resize(address * unit);
    content.insert(content.end(), data.begin(), data.end());
    return true;
  }
  auto setting = settings_.find(code);
  if (setting == settings_.end() || data.size() != setting->second.size()) return false;
  if (code == kStartStop) {
    if (data[0] > 2 || settings_[kMode][0] != 1) return false;
    triggered_ = false;
  }
  if (code == kLedEnable && data[0] != 0 && !RunningLocked()) enabled_early_ = true;
  const bool slow = code == kMode || code == kStartStop;
  to_come_[code] = {Steady::now() + (slow ? slow_ : Duration::zero()), data};
  ComeIntoForceLocked();
  return true;
}

std::optional<std::vector<uint8_t>> Dlpc350Device::ReadLocked(int code) {
  switch (code) {
    case kPower:
      return Bytes{static_cast<uint8_t>(standby_)};
    case kVersion:  // 3.1.0, and the same again for the three other components
      return Bytes{0, 0, 1, 3, 0, 0, 1, 3, 0, 0, 1, 3, 0, 0, 1, 3};
    case kHardware:
      return Bytes{static_cast<uint8_t>(1 | faults_.hardware_errors)};
    case kSystem:
      return Bytes{1};
    case kMain:
      return Bytes{static_cast<uint8_t>((faults_.parked || standby_ ? 1 : 0) |
                                        (RunningLocked() ? 2 : 0) | (faults_.frozen ? 4 : 0))};
    case kValidate:
      if (validation_reads_ > 0) {
        --validation_reads_;
        return Bytes{0x80};
      }
      return Bytes{ValidationLocked()};
    case kMailboxData: {
      const int mailbox = settings_[kMailbox][0];
      if (mailbox != 1 && mailbox != 2) return std::nullopt;
      const Bytes& content = mailbox == 1 ? images_ : patterns_;
      const size_t from = size_t{settings_[kMailboxAddress][0]} * (mailbox == 1 ? 1 : 3);
      if (from > content.size()) return std::nullopt;
      return Bytes(content.begin() + static_cast<long>(from), content.end());
    }
    default: {
      auto setting = settings_.find(code);
      if (setting == settings_.end()) return std::nullopt;
      return setting->second;
    }
  }
}

// As the guide has it: shortest exposures by depth (table of minimum exposure in any pattern mode).
uint8_t Dlpc350Device::ValidationLocked() const {
  static constexpr uint32_t kShortest[] = {0, 235, 700, 1570, 1700, 2000, 2500, 4500, 8333};
  const Bytes& times = settings_.at(kExposure);
  const uint32_t exposure = Word(times, 0), period = Word(times, 4);
  uint8_t bits = 0;
  if (exposure != period && period < exposure + 230) bits |= 0x10;
  for (size_t at = 0; at + 3 <= patterns_.size(); at += 3) {
    const int trigger = patterns_[at] & 3, number = patterns_[at] >> 2;
    const int depth = patterns_[at + 1] & 15;
    const bool black = patterns_[at + 2] & 2;
    if (depth < 1 || depth > 8) return bits | 0x02;
    if (number >= 24 / depth && !(depth == 1 && number == 24)) bits |= 0x02;
    if (exposure < kShortest[depth]) bits |= 0x01;
    if ((trigger == 1 || trigger == 2) && !black) bits |= 0x08;
  }
  return bits;
}

bool Dlpc350Device::RunningLocked() const {
  if (standby_ || faults_.sequencer_stopped) return false;
  if (settings_.at(kMode)[0] == 0) return true;
  return settings_.at(kStartStop)[0] == 2 && validated_ && validation_reads_ == 0 &&
         (ValidationLocked() & 3) == 0;
}

bool Dlpc350Device::LitLocked() const {
  const Bytes& current = settings_.at(kLedCurrent);
  const bool any = std::any_of(current.begin(), current.end(), [](uint8_t c) { return c != 255; });
  return any && !standby_ && !faults_.parked && (settings_.at(kLedEnable)[0] & 0x0f) != 0;
}

Projection Dlpc350Device::ShownLocked() const {
  if (!LitLocked() || !RunningLocked()) return Pattern{};
  if (settings_.at(kMode)[0] == 0 || settings_.at(kSource)[0] == 0) return video_;
  if (patterns_.size() < 3 || images_.empty()) return Pattern{};
  if ((patterns_[0] & 3) != 0 && !triggered_) return Pattern{};
  const int number = patterns_[0] >> 2, depth = patterns_[1] & 15;
  Pattern white;
  white.arrangement = PatternArrangement::kFull;
  if (depth == 1 && number == 24) return white;
  auto stored = flash_.find({images_[0], number, depth});
  // What is in a place that nobody filled is light, but none that anybody asked for.
  if (stored == flash_.end()) {
    white.grid = 1024;
    return white;
  }
  return stored->second;
}

void Dlpc350Device::LightLocked() {
  on_wall_ = ShownLocked();
  if (world_ == nullptr) return;
  const TimePoint now = world_->clock().Now();
  world_->RampProjection(now, now, on_wall_);
}

void Dlpc350Device::SetFaults(const Faults& faults) {
  MutexLock lock(&mutex_);
  faults_ = faults;
  LightLocked();
}

void Dlpc350Device::Unplug(bool out) {
  MutexLock lock(&mutex_);
  unplugged_ = out;
  replies_.clear();
  message_.clear();
  changed_.SignalAll();
}

void Dlpc350Device::PowerCycle(bool standby) {
  MutexLock lock(&mutex_);
  ResetLocked(standby);
}

void Dlpc350Device::SetVideoInput(const Projection& picture) {
  MutexLock lock(&mutex_);
  video_ = picture;
  LightLocked();
}

void Dlpc350Device::TriggerIn() {
  MutexLock lock(&mutex_);
  triggered_ = true;
  LightLocked();
}

std::optional<Pattern> Dlpc350Device::OnWall() {
  MutexLock lock(&mutex_);
  ComeIntoForceLocked();
  const Pattern* const pattern = std::get_if<Pattern>(&on_wall_);
  if (pattern == nullptr) return {};
  return *pattern;
}

std::array<int, 3> Dlpc350Device::LedCurrents() const {
  MutexLock lock(&mutex_);
  if (!LitLocked()) return {0, 0, 0};
  const Bytes& current = settings_.at(kLedCurrent);
  return {255 - current[0], 255 - current[1], 255 - current[2]};
}

std::vector<uint8_t> Dlpc350Device::Setting(int command) const {
  MutexLock lock(&mutex_);
  auto setting = settings_.find(command);
  return setting == settings_.end() ? Bytes{} : setting->second;
}

int Dlpc350Device::woken() const {
  MutexLock lock(&mutex_);
  return woken_;
}

bool Dlpc350Device::enabled_early() const {
  MutexLock lock(&mutex_);
  return enabled_early_;
}

}  // namespace lightstage::sim
