// What a rig file's lamps table with driver = "dmx" says, as values.
#pragma once

#include "base/clock.h"
#include "base/toml.h"
#include "drivers/dmx/slots.h"
#include "drivers/dmx/usb_port.h"

namespace lightstage::dmx {

enum class WidgetKind { kOpen, kPro };

struct DmxOptions {
  WidgetKind widget = WidgetKind::kOpen;
  UsbSelector device;  // serial, address, or both
  ChannelMap channels;
  Duration settle{};     // of the fixtures, from a frame with new levels until the light is there
  double frame_hz = 30;  // kOpen: how often the frame is sent
};

// Reads the lamps' table strictly; errors go into the table.
DmxOptions ParseDmxOptions(const TomlTable& table);

}  // namespace lightstage::dmx
