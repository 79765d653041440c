#include "drivers/modbus/discovery.h"

#include <algorithm>
#include <filesystem>

#include "base/status.h"

namespace lightstage {
namespace {

constexpr char kRest[] =
    "baud = 115200               # as set on the device\n"
    "parity = \"none\"             # likewise\n"
    "unit = 1                    # likewise\n"
    "# an axis: profile = \"…\", steps_per_degree = …; lamps: kind = \"coils\", count = …\n";

}  // namespace

absl::StatusOr<std::vector<Discovered>> DiscoverModbus(const std::string& directory) {
  std::vector<Discovered> found;
  std::error_code error;
  std::filesystem::directory_iterator entry(directory, error);
  // Without a serial port udev makes no such folder.
  if (error && error != std::errc::no_such_file_or_directory) {
    return ErrnoError(error.value(), "looking for serial ports in", directory);
  }
  if (!error) {
    for (; entry != std::filesystem::directory_iterator(); entry.increment(error)) {
      const std::string path = entry->path().string();
      found.push_back({absl::StrCat("serial port ", entry->path().filename().string(),
                                    ": Modbus devices may be on it; it was not spoken to"),
                       absl::StrCat("driver = \"modbus\"\nserial_port = \"", path, "\"\n", kRest)});
    }
    if (error) return ErrnoError(error.value(), "looking for serial ports in", directory);
  }
  std::sort(found.begin(), found.end(),
            [](const Discovered& a, const Discovered& b) { return a.what < b.what; });
  found.push_back(
      {"Modbus TCP: devices do not announce themselves, and the network is not scanned for "
       "them; take the address from the device's display or the DHCP server",
       "driver = \"modbus\"\n# host = \"192.168.…\"\n# port = 502\n# unit = 1\n"});
  return found;
}

}  // namespace lightstage
