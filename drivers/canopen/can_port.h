// One attachment to a CAN bus: frames go out, frames and the controller's own state come in. Classic CAN with 11-bit identifiers,
// which is all that CANopen uses.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "absl/functional/any_invocable.h"
#include "absl/status/statusor.h"
#include "base/clock.h"

namespace lightstage::canopen {

struct CanFrame {
  uint16_t id = 0;   // 0 to 0x7FF
  uint8_t size = 0;  // bytes of `data` that count, 0 to 8
  std::array<uint8_t, 8> data{};
  std::span<const uint8_t> bytes() const { return {data.data(), size}; }
  bool operator==(const CanFrame&) const = default;
};

// `bytes` beyond the eighth are not taken.
CanFrame MakeFrame(uint16_t id, std::span<const uint8_t> bytes);
// "583 4B 41 60 00 37 02 00 00", as the tools write it.
std::string FrameText(const CanFrame& frame);

// ISO 11898-1's fault confinement, as the controller of this end tells it.
enum class CanState { kActive, kWarning, kPassive, kBusOff };
std::string_view CanStateName(CanState state);

struct CanEvent {
  enum class Kind { kFrame, kError } kind = Kind::kFrame;
  TimePoint time{};               // on the rig's clock, as near to the wire as the port can tell
  CanFrame frame;                 // kFrame
  std::optional<CanState> state;  // kError: what the controller changed to, if it did
  std::string error;              // kError: in words
};

class CanPort {
 public:
  virtual ~CanPort() = default;

  // Any thread. Hands the frame to the controller; nobody confirms that it was heard. UNAVAILABLE / DEVICE_LOST if the interface is
  // gone or down, or takes no more frames because none gets through.
  virtual absl::Status Send(const CanFrame& frame) = 0;

  // One thread. The next event, or nothing after `timeout`. UNAVAILABLE / DEVICE_LOST: the port is of no more use.
  virtual absl::StatusOr<std::optional<CanEvent>> Receive(Duration timeout) = 0;

  // What is known when the port was opened; later changes come as events.
  virtual CanState state() const = 0;
};

using CanPortOpener = absl::AnyInvocable<absl::StatusOr<std::unique_ptr<CanPort>>()>;

}  // namespace lightstage::canopen
