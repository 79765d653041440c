// A widget: what puts slots on a DMX512 line. The two kinds that there are.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "drivers/dmx/options.h"
#include "drivers/dmx/usb_port.h"

namespace lightstage::dmx {

// For one thread at a time. After an error of any method it is of no more use and holds the device no longer.
class DmxWidget {
 public:
  // Does not need the device. What is on the line then: nothing (open), the last slots again and again (pro).
  virtual ~DmxWidget() = default;

  // As the widget says itself.
  virtual std::string model() const = 0;
  virtual std::string serial() const = 0;

  // Returns when a whole packet with `slots`, begun after the call, has left the widget, as far as it lets one know (README.md,
  // "What is confirmed"). Errors as UsbPort's.
  virtual absl::Status Show(std::span<const uint8_t> slots) = 0;
  // OK if the last slots are still being sent.
  virtual absl::Status Check() = 0;
};

// Enttec Open DMX USB. Sends `slots` slots, all 0, from now on, `frame_hz` times a second on a thread of its own.
absl::StatusOr<std::unique_ptr<DmxWidget>> StartOpenWidget(std::unique_ptr<UsbPort> port,
                                                           Clock& clock, size_t slots,
                                                           double frame_hz);

// Enttec DMX USB Pro. Asks what it is.
absl::StatusOr<std::unique_ptr<DmxWidget>> StartProWidget(std::unique_ptr<UsbPort> port,
                                                          Clock& clock);

}  // namespace lightstage::dmx
