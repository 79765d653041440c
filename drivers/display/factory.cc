#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "drivers/display/display_link.h"
#include "drivers/display/driver.h"

namespace lightstage {

Driver<Projector> DisplayDriver() {
  Driver<Projector> driver;
  driver.parse = [](const TomlTable& table) -> DeviceOpener<Projector> {
    DisplayOptions options = ParseDisplayOptions(table);
    return [options](const DeviceContext& context) {
      return OpenLinkedProjector(context, "display",
                                 std::make_unique<DisplayLink>(context, options));
    };
  };
  return driver;
}

Discovery DisplayDiscovery() {
  return []() -> absl::StatusOr<std::vector<Discovered>> {
    std::vector<Discovered> found;
    absl::Status none;
    for (const std::string backend : {"x11", "kmsdrm"}) {
      const absl::StatusOr<std::vector<ScreenInfo>> outputs =
          Screen::ListOutputs({.backend = backend});
      none = none.ok() ? outputs.status() : Annotate(outputs.status(), MessageOf(none));
      if (!outputs.ok()) continue;
      for (const ScreenInfo& output : *outputs) {
        found.push_back({absl::StrFormat("output %s, %dx%d at %.4g Hz (%s)", output.output,
                                         output.width, output.height, output.refresh_hz,
                                         backend == "x11" ? "X server" : "without an X server"),
                         absl::StrCat("[projector]\ndriver = \"display\"\nbackend = \"", backend,
                                      "\"\noutput = \"", output.output,
                                      "\"\n# [geometry.projector] must say width = ", output.width,
                                      ", height = ", output.height, "\n")});
      }
    }
    if (found.empty()) return none;
    return found;
  };
}

}  // namespace lightstage
