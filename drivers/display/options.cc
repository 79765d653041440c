#include "drivers/display/options.h"

namespace lightstage {

DisplayOptions ParseDisplayOptions(const TomlTable& table) {
  DisplayOptions options;
  ScreenOptions& screen = options.screen;
  screen.backend = table.OneOf("backend", {"x11", "kmsdrm"}, "x11");
  if (table.Has("x_display")) {
    screen.x_display = table.String("x_display");
    if (screen.backend != "x11") table.ErrorAt("x_display", "is for backend = \"x11\" only");
  }
  if (table.Has("output")) screen.output = table.String("output");
  if (table.Has("output_index")) {
    screen.output_index = static_cast<int>(table.Int("output_index", 0, 63));
  }
  if (screen.output.empty() == (screen.output_index < 0)) {
    table.ErrorAt("",
                  "needs either output = \"…\" (its name, as the search for devices shows it) "
                  "or output_index = …");
  }
  screen.renderer = table.OneOf("renderer", {"accelerated", "software"}, "accelerated");
  screen.frames = static_cast<int>(table.Int("frames", 1, 60, 2));
  options.gamma = table.Double("gamma", 0.2, 5, 1.0);
  options.settle = table.Time("settle_ms", 0, 2000, 0.0);
  return options;
}

}  // namespace lightstage
