// In place of factory.cc where libusb was missing at build time.
#include "drivers/api/not_built.h"
#include "drivers/dmx/driver.h"

namespace lightstage {
namespace {

constexpr char kMissing[] =
    "this binary was built without libusb: install libusb-1.0-0-dev and build again";

}  // namespace

Driver<Lamps> DmxDriver() { return NotBuiltDriver<Lamps>(kMissing); }
Discovery DmxDiscovery() { return NotBuiltDiscovery(kMissing); }

}  // namespace lightstage
