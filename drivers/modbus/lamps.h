// Lamps on relay or dimmer boards that speak Modbus: a coil or a holding register per lamp.
#pragma once

#include <memory>
#include <vector>

#include "drivers/api/lamps.h"
#include "drivers/modbus/options.h"

namespace lightstage {

// As a DeviceOpener. What Set and Dark add to the contract's errors: FAILED_PRECONDITION / LAMP_NOT_CONFIRMED, naming the lamp that
// the board reads back differently.
absl::StatusOr<std::unique_ptr<Lamps>> OpenModbusLamps(const ModbusLampsOptions& options,
                                                       const DeviceContext& context);

// Addresses that follow each other, and which of a board's lamps are there: one request's worth.
struct LampRun {
  int first = 0;
  std::vector<int> lamps;  // of the board; lamps[i] is at first + i
};
// In order of address, each at most `most` long.
std::vector<LampRun> LampRuns(const std::vector<int>& addresses, size_t most);

}  // namespace lightstage
