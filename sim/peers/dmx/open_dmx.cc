#include "sim/peers/dmx/open_dmx.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>

#include "absl/strings/str_format.h"

namespace lightstage::sim {
namespace {

// Bytes from the host that the chip holds (data sheet DS_FT232R, "FIFO RX Buffer").
constexpr size_t kBuffer = 128;

// What a receiver must be able to take (ANSI E1.11): less than this is no break and no mark.
constexpr Duration kShortestBreak = std::chrono::microseconds(88);
constexpr Duration kShortestMark = std::chrono::microseconds(8);
constexpr double kSlowest = 245000, kFastest = 255000;  // bit/s

// In eighths, by the code in bits 14, 15 and 16 (ftdi_sio.h: ".000 .500 .250 .125 .375 .625 .750 .875").
constexpr int kEighths[8] = {0, 4, 2, 1, 3, 5, 6, 7};

double BaudOf(uint16_t value, uint16_t index) {
  const int divisor = value & 0x3FFF;
  const int eighths = kEighths[(value >> 14 & 3) | (index & 1) << 2];
  if (divisor == 0 && eighths == 0) return 3e6;
  if (divisor == 1 && eighths == 0) return 2e6;
  return 3e6 / (divisor + eighths / 8.0);
}

}  // namespace

int OpenDmx::whole_frames() const {
  MutexLock lock(&mutex_);
  return fixtures_.packets();
}

std::vector<std::string> OpenDmx::refusals() const {
  MutexLock lock(&mutex_);
  return refusals_;
}

bool OpenDmx::OnRequest(const dmx::UsbRequest& request, TimePoint now) {
  if (request.type != 0x40) return false;
  switch (request.request) {
    case 0:  // FTDI_SIO_RESET
      if (request.value > 2) return false;
      if (request.value == 0) Reset();
      buffer_.clear();
      return true;
    case 1:  // FTDI_SIO_MODEM_CTRL
      if (request.value & 0x0200) rts_ = request.value & 2;
      return true;
    case 2:  // FTDI_SIO_SET_FLOW_CTRL
      hand_shake_ = request.index >> 8 != 0;
      return true;
    case 3:  // FTDI_SIO_SET_BAUD_RATE
      baud_ = BaudOf(request.value, request.index);
      return true;
    case 4:  // FTDI_SIO_SET_DATA
      data_bits_ = request.value & 0xFF;
      parity_ = request.value >> 8 & 7;
      stop_bits_ = (request.value >> 11 & 7) == 2 ? 2 : 1;
      Break((request.value & 0x4000) != 0, now);
      return true;
    case 9:  // FTDI_SIO_SET_LATENCY_TIMER
      return request.value >= 1 && request.value <= 255;
    default:
      return false;
  }
}

void OpenDmx::Reset() {
  hand_shake_ = false;
  rts_ = false;
}

std::optional<std::vector<uint8_t>> OpenDmx::OnRequestIn(const dmx::UsbRequest& request,
                                                         TimePoint now) {
  if (request.type != 0xC0 || request.request != 5) return std::nullopt;
  return OnPoll(now);
}

std::vector<uint8_t> OpenDmx::OnPoll(TimePoint /*now*/) {
  const bool empty = buffer_.empty() && fault_ != UsbFault::kNeverEmpty;
  // THRE: there is room; TEMT: all has gone.
  return {0x01, static_cast<uint8_t>((buffer_.size() < kBuffer ? 0x20 : 0) | (empty ? 0x40 : 0))};
}

TimePoint OpenDmx::OnBytes(std::span<const uint8_t> bytes, TimePoint now) {
  const Duration each = FromSeconds((1 + data_bits_ + (parity_ != 0) + stop_bits_) / baud_);
  for (uint8_t byte : bytes) {
    const TimePoint begin = buffer_.empty() ? now : std::max(now, buffer_.back().end);
    buffer_.push_back({byte, begin, begin + each});
  }
  if (buffer_.empty()) return now;
  WakeAt(buffer_.back().end);
  if (buffer_.size() <= kBuffer) return now;
  return buffer_[buffer_.size() - kBuffer - 1].end;
}

void OpenDmx::OnAdvance(TimePoint now) {
  while (!buffer_.empty() && buffer_.front().end <= now) {
    const OnLine out = buffer_.front();
    buffer_.pop_front();
    Hear(out);
  }
}

void OpenDmx::OnPowerLost(TimePoint /*now*/) {
  buffer_.clear();
  if (hearing_ == Hearing::kSlots) Refuse("the signal ended within a frame");
  hearing_ = Hearing::kNothing;
  Reset();
  break_on_ = false;
  baud_ = 9600;
  stop_bits_ = 1;
}

// ---- The receiver at the other end of the line.

void OpenDmx::Break(bool on, TimePoint now) {
  if (on == break_on_) return;
  break_on_ = on;
  if (!on) {
    break_end_ = now;
    hearing_ = Hearing::kStartCode;
    if (now - break_begin_ < kShortestBreak) {
      Refuse(absl::StrFormat("a break of %g us", Seconds(now - break_begin_) * 1e6));
    }
    return;
  }
  break_begin_ = now;
  if (!buffer_.empty()) {
    buffer_.clear();
    Refuse("a break while bytes were on their way");
  } else if (hearing_ == Hearing::kSlots) {
    Refuse(absl::StrFormat("a frame of %d slots", heard_.size()));
  }
  hearing_ = Hearing::kNothing;
}

std::string OpenDmx::WrongLine() const {
  if (baud_ < kSlowest || baud_ > kFastest) return absl::StrFormat("%g baud", baud_);
  if (data_bits_ != 8 || parity_ != 0 || stop_bits_ != 2) return "not 8N2";
  if (rts_) return "RTS keeps the line driver off";
  if (hand_shake_) return "the chip waits for a hand-shake";
  return "";
}

void OpenDmx::Hear(const OnLine& heard) {
  if (hearing_ == Hearing::kNothing || hearing_ == Hearing::kDone) return;
  if (std::string wrong = WrongLine(); !wrong.empty()) return Refuse(std::move(wrong));
  if (hearing_ == Hearing::kStartCode) {
    if (heard.begin - break_end_ < kShortestMark) return Refuse("too short a mark after the break");
    if (heard.byte != 0) return Refuse(absl::StrFormat("start code %d", heard.byte));
    hearing_ = Hearing::kSlots;
    heard_.clear();
    return;
  }
  heard_.push_back(heard.byte);
  if (heard_.size() < slots_) return;
  hearing_ = Hearing::kDone;
  fixtures_.Receive(heard_, heard.end);
}

void OpenDmx::Refuse(std::string why) {
  hearing_ = Hearing::kNothing;
  spdlog::warn("the lamps on {} believe no frame: {}", identity().serial, why);
  if (refusals_.size() < 100) refusals_.push_back(std::move(why));
}

}  // namespace lightstage::sim
