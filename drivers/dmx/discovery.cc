#include "drivers/dmx/discovery.h"

#include <algorithm>
#include <cctype>
#include <string>

#include "absl/strings/str_cat.h"
#include "base/toml.h"
#include "base/utf8.h"

namespace lightstage::dmx {
namespace {

bool Contains(std::string text, std::string_view part) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text.find(part) != std::string::npos;
}

}  // namespace

std::optional<WidgetKind> LooksLike(const UsbIdentity& device) {
  if (Contains(device.product, "dmx") && Contains(device.product, "pro")) return WidgetKind::kPro;
  if (Contains(device.product, "ft232") || Contains(device.product, "dmx"))
    return WidgetKind::kOpen;
  return std::nullopt;
}

std::vector<Discovered> Describe(const std::vector<UsbIdentity>& devices) {
  std::vector<Discovered> found;
  for (const UsbIdentity& device : devices) {
    const std::optional<WidgetKind> kind = LooksLike(device);
    Discovered entry;
    if (!device.unreadable.empty()) {
      entry.what = absl::StrCat("FTDI device at USB ", device.address,
                                "; its names could not be read: ", device.unreadable);
    } else {
      entry.what = absl::StrCat(
          CleanUtf8(device.manufacturer), " ", CleanUtf8(device.product), ", ",
          device.serial.empty() ? "without serial number"
                                : absl::StrCat("serial number ", CleanUtf8(device.serial)),
          ", at USB ", device.address, ": ",
          kind == WidgetKind::kPro ? "a DMX USB Pro"
          : kind.has_value()       ? "an Open DMX, or any serial cable with this chip"
                                   : "an FTDI serial converter, perhaps no DMX widget");
    }
    absl::StrAppend(&entry.toml, "[lamps]\ndriver = \"dmx\"\n", kind.has_value() ? "" : "# ",
                    "widget = ", kind == WidgetKind::kPro ? "\"pro\"" : "\"open\"", "\n");
    if (device.serial.empty()) {
      absl::StrAppend(&entry.toml, "address = ", TomlQuoted(CleanUtf8(device.address)), "\n");
    } else {
      absl::StrAppend(&entry.toml, "serial = ", TomlQuoted(CleanUtf8(device.serial)), "\n");
    }
    absl::StrAppend(&entry.toml,
                    "# first_channel = 1\n# lamp_count = 8\n# bits = 8\n# settle_ms = 40\n");
    found.push_back(std::move(entry));
  }
  return found;
}

}  // namespace lightstage::dmx
