#include "drivers/canopen/can_port.h"

#include <algorithm>

#include "absl/strings/str_format.h"

namespace lightstage::canopen {

CanFrame MakeFrame(uint16_t id, std::span<const uint8_t> bytes) {
  CanFrame frame;
  frame.id = id;
  frame.size = static_cast<uint8_t>(std::min(bytes.size(), frame.data.size()));
  std::copy_n(bytes.begin(), frame.size, frame.data.begin());
  return frame;
}

std::string FrameText(const CanFrame& frame) {
  std::string text = absl::StrFormat("%03X", frame.id);
  for (uint8_t byte : frame.bytes()) text += absl::StrFormat(" %02X", byte);
  return text;
}

std::string_view CanStateName(CanState state) {
  switch (state) {
    case CanState::kActive:
      return "error-active";
    case CanState::kWarning:
      return "error-warning";
    case CanState::kPassive:
      return "error-passive";
    case CanState::kBusOff:
      return "bus-off";
  }
  return "unknown";
}

}  // namespace lightstage::canopen
