#include "absl/strings/str_cat.h"
#include "drivers/dlpc350/driver.h"
#include "drivers/dlpc350/link.h"

namespace lightstage {

Driver<Projector> Dlpc350Driver(Driver<Projector> screen) {
  Driver<Projector> driver;
  driver.parse = [screen = std::move(screen)](const TomlTable& table) -> DeviceOpener<Projector> {
    dlpc350::Options options = dlpc350::ParseOptions(table);
    DeviceOpener<Projector> open_screen;
    if (!options.flash && table.Has("mode")) {
      if (screen.parse == nullptr) {
        table.Table("display").Ignore();
        table.ErrorAt("mode", "\"video\" needs a driver for the output, which this binary has not");
      } else {
        open_screen = screen.parse(table.Table("display", true));
      }
    }
    return [options, open_screen = std::move(open_screen)](
               const DeviceContext& context) mutable -> absl::StatusOr<std::unique_ptr<Projector>> {
      std::unique_ptr<Projector> output;
      if (!options.flash) {
        ASSIGN_OR_RETURN(output, open_screen(context));
      }
      auto open_port = [path = options.path, serial = options.serial] {
        return dlpc350::OpenHidDevice(path, serial);
      };
      return OpenLinkedProjector(
          context, "dlpc350",
          std::make_unique<dlpc350::Link>(context, options, open_port, std::move(output)));
    };
  };
  return driver;
}

Discovery Dlpc350Discovery() {
  return []() -> absl::StatusOr<std::vector<Discovered>> {
    ASSIGN_OR_RETURN(std::vector<dlpc350::HidDevice> devices, dlpc350::ListHidDevices());
    std::vector<Discovered> found;
    for (const dlpc350::HidDevice& device : devices) {
      found.push_back(
          {absl::StrCat(device.maker, " ", device.product, ", serial ",
                        device.serial.empty() ? "none" : device.serial, ", at ", device.path),
           absl::StrCat("[projector]\ndriver = \"dlpc350\"\n",
                        device.serial.empty()
                            ? absl::StrCat("path = ", TomlQuoted(device.path))
                            : absl::StrCat("serial = ", TomlQuoted(device.serial)),
                        "\n"
                        "# mode = \"flash\" with [[projector.patterns]], or \"video\" with "
                        "[projector.display]\n# led_current = [red, green, blue], 0 to 255, and "
                        "led_current_limit\n")});
    }
    return found;
  };
}

}  // namespace lightstage
