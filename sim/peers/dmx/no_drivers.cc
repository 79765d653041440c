// In place of drivers.cc where libusb was missing at build time.
#include "drivers/dmx/driver.h"
#include "sim/peers/dmx/drivers.h"

namespace lightstage::sim {

void RegisterDmxPeer(DriverRegistry& registry, const std::shared_ptr<Simulation>&) {
  registry.lamps["sim-dmx"] = DmxDriver();  // says what is missing
}

}  // namespace lightstage::sim
