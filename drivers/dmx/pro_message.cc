#include "drivers/dmx/pro_message.h"

#include <algorithm>

#include "absl/strings/str_format.h"
#include "drivers/dmx/slots.h"

namespace lightstage::dmx {
namespace {

constexpr uint8_t kStart = 0x7E, kEnd = 0xE7;
constexpr size_t kHead = 4;

Duration InTicks(uint8_t ticks) { return Duration(10670) * ticks; }

}  // namespace

std::vector<uint8_t> EncodePro(uint8_t label, std::span<const uint8_t> data) {
  std::vector<uint8_t> bytes = {kStart, label, static_cast<uint8_t>(data.size() & 0xFF),
                                static_cast<uint8_t>(data.size() >> 8)};
  bytes.insert(bytes.end(), data.begin(), data.end());
  bytes.push_back(kEnd);
  return bytes;
}

std::vector<uint8_t> EncodeProGetParameters() {
  constexpr uint8_t kNoUserData[2] = {0, 0};
  return EncodePro(kProGetParameters, kNoUserData);
}

std::vector<uint8_t> EncodeProGetSerial() { return EncodePro(kProGetSerial, {}); }

std::vector<uint8_t> EncodeProOutput(std::span<const uint8_t> slots) {
  std::vector<uint8_t> data = {kStartCode};
  data.insert(data.end(), slots.begin(), slots.end());
  return EncodePro(kProOutput, data);
}

void ProDecoder::Feed(std::span<const uint8_t> bytes) {
  pending_.insert(pending_.end(), bytes.begin(), bytes.end());
}

std::optional<ProMessage> ProDecoder::Next() {
  auto at = pending_.begin();
  std::optional<ProMessage> message;
  while ((at = std::find(at, pending_.end(), kStart)) != pending_.end()) {
    const auto available = static_cast<size_t>(pending_.end() - at);
    if (available < kHead) break;
    const size_t length = static_cast<size_t>(at[2]) | static_cast<size_t>(at[3]) << 8;
    if (length > kProMaxData) {
      ++at;
      continue;
    }
    if (available < kHead + length + 1) break;
    if (at[static_cast<ptrdiff_t>(kHead + length)] != kEnd) {
      ++at;
      continue;
    }
    const auto data = at + static_cast<ptrdiff_t>(kHead);
    message = ProMessage{at[1], {data, data + static_cast<ptrdiff_t>(length)}};
    at += static_cast<ptrdiff_t>(kHead + length + 1);
    break;
  }
  pending_.erase(pending_.begin(), at);
  return message;
}

std::optional<ProParameters> DecodeProParameters(std::span<const uint8_t> data) {
  if (data.size() < 5) return std::nullopt;
  return ProParameters{.firmware_major = data[1],
                       .firmware_minor = data[0],
                       .break_time = InTicks(data[2]),
                       .mark_after_break = InTicks(data[3]),
                       .packets_per_second = data[4]};
}

std::optional<std::string> DecodeProSerial(std::span<const uint8_t> data) {
  if (data.size() != 4) return std::nullopt;
  if (std::all_of(data.begin(), data.end(), [](uint8_t byte) { return byte == 0xFF; })) {
    return "not programmed";
  }
  for (uint8_t byte : data) {
    if ((byte & 0x0F) > 9 || (byte >> 4) > 9) return std::nullopt;
  }
  return absl::StrFormat("%02x%02x%02x%02x", data[3], data[2], data[1], data[0]);
}

Duration ProTimeToLine(const ProParameters& parameters, size_t slots) {
  const Duration packet = parameters.break_time + parameters.mark_after_break + LineTime(slots + 1);
  const Duration period = parameters.packets_per_second > 0
                              ? Duration(std::chrono::seconds(1)) / parameters.packets_per_second
                              : packet;
  return std::max(period, packet) + packet;
}

}  // namespace lightstage::dmx
