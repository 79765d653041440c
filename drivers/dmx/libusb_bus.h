// The USB of this machine, through libusb-1.0.
#pragma once

#include <memory>
#include <string_view>

#include "drivers/dmx/usb_port.h"

namespace lightstage::dmx {

std::unique_ptr<UsbBus> MakeLibusbBus();

// What a libusb_error means to us; OK of 0 and above.
absl::Status LibusbError(int code, std::string_view what);

}  // namespace lightstage::dmx
