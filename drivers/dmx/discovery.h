// What a rig file needs to know of the widgets that are plugged in.
#pragma once

#include <optional>
#include <vector>

#include "drivers/api/registry.h"
#include "drivers/dmx/options.h"
#include "drivers/dmx/usb_port.h"

namespace lightstage::dmx {

// By the product's name; nothing if it is neither a Pro nor a bare FT232R. An Open DMX cannot be told from any other serial cable with an
// FT232R.
std::optional<WidgetKind> LooksLike(const UsbIdentity& device);

std::vector<Discovered> Describe(const std::vector<UsbIdentity>& devices);

}  // namespace lightstage::dmx
