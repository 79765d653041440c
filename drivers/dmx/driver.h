// The driver "dmx": lamps on a DMX512 line, through an Enttec Open DMX USB or an Enttec DMX USB Pro. Options in README.md.
#pragma once

#include "drivers/api/lamps.h"
#include "drivers/api/registry.h"

namespace lightstage {

Driver<Lamps> DmxDriver();

// What FTDI chips (0403:6001) are plugged in, and which of the two widgets they look like. Opens them to read their names; whatever drives
// them goes on.
Discovery DmxDiscovery();

}  // namespace lightstage
