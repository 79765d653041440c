#include "drivers/canopen/messages.h"

#include <algorithm>

#include "absl/strings/str_format.h"
#include "base/strings.h"

namespace lightstage::canopen {
namespace {

struct CodeName {
  uint16_t code, mask;
  std::string_view name;
};

// The narrower first.
constexpr CodeName kEmergencyNames[] = {
    {0x8110, 0xFFFF, "CAN overrun, objects lost"},
    {0x8120, 0xFFFF, "CAN in error passive mode"},
    {0x8130, 0xFFFF, "life guard or heartbeat error"},
    {0x8140, 0xFFFF, "recovered from bus-off"},
    {0x8150, 0xFFFF, "CAN-ID collision"},
    {0x8210, 0xFFFF, "PDO not processed due to length error"},
    {0x8220, 0xFFFF, "PDO length exceeded"},
    {0x8230, 0xFFFF, "destination object of a DAM MPDO not available"},
    {0x8240, 0xFFFF, "unexpected SYNC data length"},
    {0x8250, 0xFFFF, "RPDO timeout"},
    {0x0000, 0xFF00, "error reset or no error"},
    {0x1000, 0xFF00, "generic error"},
    {0x2100, 0xFF00, "current, device input side"},
    {0x2200, 0xFF00, "current inside the device"},
    {0x2300, 0xFF00, "current, device output side"},
    {0x2000, 0xF000, "current"},
    {0x3100, 0xFF00, "mains voltage"},
    {0x3200, 0xFF00, "voltage inside the device"},
    {0x3300, 0xFF00, "output voltage"},
    {0x3000, 0xF000, "voltage"},
    {0x4100, 0xFF00, "ambient temperature"},
    {0x4200, 0xFF00, "device temperature"},
    {0x4000, 0xF000, "temperature"},
    {0x5000, 0xF000, "device hardware"},
    {0x6100, 0xFF00, "internal software"},
    {0x6200, 0xFF00, "user software"},
    {0x6300, 0xFF00, "data set"},
    {0x6000, 0xF000, "device software"},
    {0x7000, 0xF000, "additional modules"},
    {0x8100, 0xFF00, "communication"},
    {0x8200, 0xFF00, "protocol error"},
    {0x8000, 0xF000, "monitoring"},
    {0x9000, 0xF000, "external error"},
    {0xF000, 0xFF00, "additional functions"},
    {0xFF00, 0xFF00, "device specific"},
};

}  // namespace

std::string NmtStateName(NmtState state) {
  switch (state) {
    case NmtState::kBootUp:
      return "boot-up";
    case NmtState::kStopped:
      return "stopped";
    case NmtState::kOperational:
      return "operational";
    case NmtState::kPreOperational:
      return "pre-operational";
  }
  return absl::StrFormat("state %02Xh", static_cast<int>(state));
}

CanFrame EncodeNmt(NmtCommand command, int node) {
  const uint8_t bytes[] = {static_cast<uint8_t>(command), static_cast<uint8_t>(node)};
  return MakeFrame(kNmt, bytes);
}

CanFrame EncodeHeartbeat(int node, NmtState state) {
  const uint8_t bytes[] = {static_cast<uint8_t>(state)};
  return MakeFrame(static_cast<uint16_t>(kHeartbeat + node), bytes);
}

CanFrame EncodeSync() { return MakeFrame(kSync, {}); }

std::optional<NmtState> DecodeHeartbeat(std::span<const uint8_t> bytes) {
  if (bytes.empty()) return std::nullopt;
  const auto state = static_cast<NmtState>(bytes[0] & 0x7F);
  switch (state) {
    case NmtState::kBootUp:
    case NmtState::kStopped:
    case NmtState::kOperational:
    case NmtState::kPreOperational:
      return state;
  }
  return std::nullopt;
}

uint32_t ConsumerHeartbeat(int producer, uint16_t time_ms) {
  return static_cast<uint32_t>(producer) << 16 | time_ms;
}

std::optional<Emergency> DecodeEmergency(std::span<const uint8_t> bytes) {
  if (bytes.size() < 8) return std::nullopt;
  Emergency emergency;
  emergency.code = static_cast<uint16_t>(bytes[0] | bytes[1] << 8);
  emergency.error_register = bytes[2];
  std::copy_n(bytes.begin() + 3, emergency.vendor.size(), emergency.vendor.begin());
  return emergency;
}

std::string_view EmergencyName(uint16_t code) {
  for (const CodeName& known : kEmergencyNames) {
    if ((code & known.mask) == known.code) return known.name;
  }
  return "unknown";
}

std::string EmergencyText(const Emergency& emergency) {
  std::string text = absl::StrFormat("emergency %04Xh (%s)", emergency.code,
                                     AbslView(EmergencyName(emergency.code)));
  if (std::any_of(emergency.vendor.begin(), emergency.vendor.end(),
                  [](uint8_t byte) { return byte != 0; })) {
    text += ", vendor's bytes";
    for (uint8_t byte : emergency.vendor) text += absl::StrFormat(" %02X", byte);
  }
  return text;
}

uint32_t EncodeMapping(const MappedObject& mapped) {
  return static_cast<uint32_t>(mapped.object.index) << 16 |
         static_cast<uint32_t>(mapped.object.sub) << 8 | mapped.bits;
}

MappedObject DecodeMapping(uint32_t entry) {
  return {{static_cast<uint16_t>(entry >> 16), static_cast<uint8_t>(entry >> 8)},
          static_cast<uint8_t>(entry)};
}

std::optional<std::vector<uint32_t>> UnpackPdo(std::span<const uint8_t> bytes,
                                               std::span<const MappedObject> mapping) {
  std::vector<uint32_t> values;
  size_t at = 0;
  for (const MappedObject& mapped : mapping) {
    if (mapped.bits == 0 || mapped.bits > 32 || at + mapped.bits > bytes.size() * 8) {
      return std::nullopt;
    }
    uint32_t value = 0;
    for (size_t bit = 0; bit < mapped.bits; ++bit, ++at) {
      value |= static_cast<uint32_t>(bytes[at / 8] >> (at % 8) & 1) << bit;
    }
    values.push_back(value);
  }
  return values;
}

std::optional<std::vector<uint8_t>> PackPdo(std::span<const uint32_t> values,
                                            std::span<const MappedObject> mapping) {
  if (values.size() != mapping.size()) return std::nullopt;
  std::vector<uint8_t> bytes;
  size_t at = 0;
  for (size_t i = 0; i < mapping.size(); ++i) {
    const size_t bits = mapping[i].bits;
    if (bits == 0 || bits > 32 || at + bits > 64) return std::nullopt;
    if (bits < 32 && values[i] >> bits != 0) return std::nullopt;
    for (size_t bit = 0; bit < bits; ++bit, ++at) {
      if (at / 8 == bytes.size()) bytes.push_back(0);
      bytes[at / 8] = static_cast<uint8_t>(bytes[at / 8] | (values[i] >> bit & 1) << (at % 8));
    }
  }
  return bytes;
}

}  // namespace lightstage::canopen
