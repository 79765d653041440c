#include "sim/peers/dmx/dmx_pro.h"

#include <algorithm>

namespace lightstage::sim {
namespace {

constexpr uint8_t kBreakTicks = 17, kMarkTicks = 2;  // of 10.67 µs
constexpr size_t kHostPacket = 64;

Duration PacketTime(size_t slots) {
  return Duration(10670) * (kBreakTicks + kMarkTicks) +
         Duration(44000) * static_cast<int64_t>(slots + 1);
}

}  // namespace

bool DmxPro::sending() const {
  MutexLock lock(&mutex_);
  return sending_;
}

void DmxPro::SetSerial(uint32_t bcd) {
  MutexLock lock(&mutex_);
  options_.serial_bcd = bcd;
}

// The chip takes what FTDI chips take; none of it matters to the widget.
bool DmxPro::OnRequest(const dmx::UsbRequest& request, TimePoint /*now*/) {
  if (request.type != 0x40) return false;
  if (request.request == 0) to_host_.clear();
  return request.request <= 4 || request.request == 9;
}

std::optional<std::vector<uint8_t>> DmxPro::OnRequestIn(const dmx::UsbRequest& request,
                                                        TimePoint /*now*/) {
  if (request.type != 0xC0 || request.request != 5) return std::nullopt;
  return std::vector<uint8_t>{0x01, 0x60};
}

TimePoint DmxPro::OnBytes(std::span<const uint8_t> bytes, TimePoint now) {
  for (uint8_t byte : bytes) Take(byte, now);
  return now;
}

// Replies come in more than one packet, as they may.
std::vector<uint8_t> DmxPro::OnPoll(TimePoint /*now*/) {
  std::vector<uint8_t> packet = {0x01, 0x60};
  const size_t most = to_host_.size() > 5 ? to_host_.size() / 2 : to_host_.size();
  for (size_t i = 0; i < std::min(most, kHostPacket - 2); ++i) {
    packet.push_back(to_host_.front());
    to_host_.pop_front();
  }
  return packet;
}

void DmxPro::OnAdvance(TimePoint now) {
  while (!pending_.empty() && pending_.front().end <= now) {
    fixtures_.Receive(pending_.front().slots, pending_.front().end);
    pending_.pop_front();
  }
}

void DmxPro::OnPowerLost(TimePoint /*now*/) {
  StopOutput();
  message_.clear();
  to_host_.clear();
}

void DmxPro::Take(uint8_t byte, TimePoint now) {
  if (message_.empty() && byte != 0x7E) return;
  message_.push_back(byte);
  if (message_.size() < 4) return;
  const size_t length = message_[2] + 256u * message_[3];
  if (length > 600) return message_.clear();
  if (message_.size() < length + 5) return;
  const std::vector<uint8_t> whole = std::move(message_);
  message_.clear();
  if (whole.back() == 0xE7) Obey(whole[1], {whole.begin() + 4, whole.end() - 1}, now);
}

void DmxPro::Obey(uint8_t label, const std::vector<uint8_t>& data, TimePoint now) {
  if (options_.chatty) Reply(5, {0x00, 0x00, 0x7E, 0xE7});  // "Received DMX Packet"
  if (label == 6) return Output(data, now);
  if (label == 3) {
    if (data.size() != 2) return;
    return Reply(
        3, {44, 1, kBreakTicks, kMarkTicks, static_cast<uint8_t>(options_.packets_per_second)});
  }
  StopOutput();  // as all other requests do
  if (label == 10 && data.empty()) {
    const uint32_t bcd = options_.serial_bcd;
    Reply(10, {static_cast<uint8_t>(bcd), static_cast<uint8_t>(bcd >> 8),
               static_cast<uint8_t>(bcd >> 16), static_cast<uint8_t>(bcd >> 24)});
  }
}

void DmxPro::Output(const std::vector<uint8_t>& data, TimePoint now) {
  if (data.size() < 25 || data.size() > 513 || data[0] != 0) return;
  const std::vector<uint8_t> slots(data.begin() + 1, data.end());
  const Duration packet = PacketTime(slots.size());
  TimePoint begin = now;
  if (sending_) {
    // With the packet after the one under way.
    begin = first_ + period_ * ((now - first_) / period_ + 1);
    while (!pending_.empty() && pending_.back().begin >= begin) pending_.pop_back();
  } else {
    sending_ = true;
    first_ = now;
    period_ = packet;
    if (options_.packets_per_second > 0) {
      period_ = std::max(period_, Duration(std::chrono::seconds(1)) / options_.packets_per_second);
    }
  }
  pending_.push_back({slots, begin, begin + packet});
  WakeAt(begin + packet);
}

void DmxPro::StopOutput() {
  sending_ = false;
  pending_.clear();
}

void DmxPro::Reply(uint8_t label, const std::vector<uint8_t>& data) {
  for (uint8_t byte : {uint8_t{0x7E}, label, static_cast<uint8_t>(data.size()), uint8_t{0}}) {
    to_host_.push_back(byte);
  }
  to_host_.insert(to_host_.end(), data.begin(), data.end());
  to_host_.push_back(0xE7);
}

}  // namespace lightstage::sim
