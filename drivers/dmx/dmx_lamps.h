// The lamps' link over a widget.
#pragma once

#include <memory>

#include "drivers/api/lamps.h"
#include "drivers/dmx/options.h"
#include "drivers/dmx/usb_port.h"
#include "drivers/link/light_link.h"

namespace lightstage::dmx {

// For OpenDmxLamps, and for tests that look at it without the contract around it. The context's clock outlives it.
std::unique_ptr<LampsLink> MakeDmxLink(const DmxOptions& options, const DeviceContext& context,
                                       std::unique_ptr<UsbBus> bus);

absl::StatusOr<std::unique_ptr<Lamps>> OpenDmxLamps(const DmxOptions& options,
                                                    const DeviceContext& context,
                                                    std::unique_ptr<UsbBus> bus);

}  // namespace lightstage::dmx
