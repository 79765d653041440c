// The driver's port to a device in the same process.
#pragma once

#include <memory>

#include "drivers/dlpc350/hid_port.h"
#include "sim/peers/dlpc350/device.h"

namespace lightstage::sim {

// As an opener for dlpc350::Link: NOT_FOUND / DEVICE_NOT_FOUND while it is unplugged. `device` outlives the ports.
dlpc350::HidOpener InProcessHid(Dlpc350Device& device, std::string serial);

}  // namespace lightstage::sim
