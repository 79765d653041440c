// Opening devices on a bus that is given: the kernel's for the driver, one within the process for tests and simulation.
#pragma once

#include <memory>
#include <string_view>

#include "drivers/api/axis.h"
#include "drivers/api/lamps.h"
#include "drivers/canopen/can_bus.h"
#include "drivers/canopen/options.h"

namespace lightstage::canopen {

// `driver`: the name it goes by in the rig file.
absl::StatusOr<std::unique_ptr<Axis>> OpenAxis(const DeviceContext& context,
                                               std::string_view driver, const AxisOptions& options,
                                               std::shared_ptr<CanBus> bus);
// As many lamps as the context's geometry has.
absl::StatusOr<std::unique_ptr<Lamps>> OpenLamps(const DeviceContext& context,
                                                 std::string_view driver,
                                                 const LampsOptions& options,
                                                 std::shared_ptr<CanBus> bus);

}  // namespace lightstage::canopen
