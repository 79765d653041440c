// In place of factory.cc where SDL2, Xlib, RandR or libdrm was missing at build time.
#include "drivers/api/not_built.h"
#include "drivers/display/driver.h"

namespace lightstage {
namespace {

constexpr char kMissing[] =
    "this binary was built without SDL2: install libsdl2-dev, libdrm-dev, libx11-dev and "
    "libxrandr-dev and build again";

}  // namespace

Driver<Projector> DisplayDriver() { return NotBuiltDriver<Projector>(kMissing); }
Discovery DisplayDiscovery() { return NotBuiltDiscovery(kMissing); }

}  // namespace lightstage
