// In place of drivers.cc where libmodbus was missing at build time.
#include "drivers/modbus/driver.h"
#include "sim/peers/modbus/drivers.h"

namespace lightstage::sim {

void RegisterModbusPeers(DriverRegistry& registry, const std::shared_ptr<Simulation>&) {
  registry.axes["sim-modbus"] = ModbusAxisDriver();  // says what is missing
  registry.lamps["sim-modbus"] = ModbusLampsDriver();
}

}  // namespace lightstage::sim
