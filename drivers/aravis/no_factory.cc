// In place of factory.cc where libaravis was missing at build time.
#include "drivers/api/not_built.h"
#include "drivers/aravis/driver.h"

namespace lightstage {
namespace {

constexpr char kMissing[] =
    "this binary was built without libaravis: install libaravis-dev and libusb-1.0-0-dev and build "
    "again";

}  // namespace

Driver<Camera> AravisDriver() { return NotBuiltDriver<Camera>(kMissing); }
Discovery AravisDiscovery() { return NotBuiltDiscovery(kMissing); }

}  // namespace lightstage
