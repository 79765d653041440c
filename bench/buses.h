// Axes and lamps on their buses (command_bench).
#pragma once

#include <string>

#include "bench/stage.h"
#include "drivers/dmx/options.h"

namespace lightstage::bench {

// TCP on loopback, or a pseudo-terminal as serial line.
absl::Status MeasureModbus(Stage& stage, bool tcp);
// `interface` of the kernel; empty: within the process.
absl::Status MeasureCanopen(Stage& stage, const std::string& interface);
absl::Status MeasureDmx(Stage& stage, dmx::WidgetKind kind);

}  // namespace lightstage::bench
