// An axis whose drive speaks Modbus, as its profile describes it.
#pragma once

#include <memory>
#include <string>

#include "drivers/api/axis.h"
#include "drivers/modbus/options.h"

namespace lightstage {

// As a DeviceOpener. DEVICE_UNSUITABLE if it is not the drive that it was before a loss.
absl::StatusOr<std::unique_ptr<Axis>> OpenModbusAxis(const ModbusAxisOptions& options,
                                                     const DeviceContext& context);

// Why a move of `asked` degrees may have changed the position by `moved`: for the message of DRIVE_IMPLAUSIBLE.
std::string ImplausibleHint(double asked, double moved);

}  // namespace lightstage
