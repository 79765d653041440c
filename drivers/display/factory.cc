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
    ASSIGN_OR_RETURN(std::vector<ScreenInfo> outputs, Screen::ListOutputs(ScreenOptions{}));
    std::vector<Discovered> found;
    for (const ScreenInfo& output : outputs) {
      found.push_back({absl::StrFormat("output %s, %dx%d at %.4g Hz", output.output, output.width,
                                       output.height, output.refresh_hz),
                       absl::StrCat("[projector]\ndriver = \"display\"\noutput = \"", output.output,
                                    "\"\n# [geometry.projector] must say width = ", output.width,
                                    ", height = ", output.height, "\n")});
    }
    return found;
  };
}

}  // namespace lightstage
