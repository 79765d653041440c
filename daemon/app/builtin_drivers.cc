#include "daemon/app/builtin_drivers.h"

#include "drivers/aravis/driver.h"
#include "drivers/canopen/driver.h"
#include "drivers/display/driver.h"
#include "drivers/dlpc350/driver.h"
#include "drivers/dmx/driver.h"
#include "drivers/modbus/driver.h"
#include "drivers/v4l2/driver.h"
#include "sim/peers/canopen/drivers.h"
#include "sim/peers/display/drivers.h"
#include "sim/peers/dlpc350/drivers.h"
#include "sim/peers/dmx/drivers.h"
#include "sim/peers/gige/drivers.h"
#include "sim/peers/modbus/drivers.h"
#include "sim/peers/uvc/drivers.h"
#include "sim/rig/drivers.h"

namespace lightstage {

std::shared_ptr<sim::Simulation> RegisterBuiltinDrivers(DriverRegistry& registry) {
  std::shared_ptr<sim::Simulation> simulation = sim::RegisterSimulatedDrivers(registry);
  sim::RegisterCanopenPeers(registry, simulation);
  sim::RegisterDisplayPeer(registry, simulation);
  sim::RegisterDlpc350Peer(registry, simulation, sim::ParseServedDisplay);
  sim::RegisterDmxPeer(registry, simulation);
  sim::RegisterGigePeer(registry, simulation);
  sim::RegisterModbusPeers(registry, simulation);
  sim::RegisterUvcPeer(registry, simulation);
  registry.cameras["aravis"] = AravisDriver();
  registry.cameras["v4l2"] = V4l2Driver();
  registry.axes["canopen"] = CanopenAxisDriver();
  registry.axes["modbus"] = ModbusAxisDriver();
  registry.lamps["canopen"] = CanopenLampsDriver();
  registry.lamps["dmx"] = DmxDriver();
  registry.lamps["modbus"] = ModbusLampsDriver();
  registry.projectors["display"] = DisplayDriver();
  registry.projectors["dlpc350"] = Dlpc350Driver(DisplayDriver());
  registry.discoveries["aravis"] = AravisDiscovery();
  registry.discoveries["canopen"] = CanopenDiscovery();
  registry.discoveries["display"] = DisplayDiscovery();
  registry.discoveries["dlpc350"] = Dlpc350Discovery();
  registry.discoveries["dmx"] = DmxDiscovery();
  registry.discoveries["modbus"] = ModbusDiscovery();
  registry.discoveries["v4l2"] = V4l2Discovery();
  return simulation;
}

}  // namespace lightstage
