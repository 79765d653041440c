// In place of drivers.cc where hidapi was missing at build time.
#include "drivers/dlpc350/driver.h"
#include "sim/peers/dlpc350/drivers.h"

namespace lightstage::sim {

void RegisterDlpc350Peer(DriverRegistry& registry, const std::shared_ptr<Simulation>&,
                         const VideoOutputParser&) {
  registry.projectors["sim-dlpc350"] = Dlpc350Driver();  // says what is missing
}

}  // namespace lightstage::sim
