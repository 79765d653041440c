#include "drivers/dmx/usb_port.h"

#include <optional>

#include "absl/strings/str_cat.h"

namespace lightstage::dmx {

absl::StatusOr<size_t> SelectDevice(std::span<const UsbIdentity> devices,
                                    const UsbSelector& selector) {
  std::string wanted;
  if (!selector.serial.empty()) absl::StrAppend(&wanted, " with serial ", selector.serial);
  if (!selector.address.empty()) absl::StrAppend(&wanted, " at ", selector.address);
  const ErrorMetadata metadata = {{"serial", selector.serial}, {"address", selector.address}};
  std::optional<size_t> found;
  std::string others;
  for (size_t i = 0; i < devices.size(); ++i) {
    const UsbIdentity& device = devices[i];
    if ((!selector.serial.empty() && device.serial != selector.serial) ||
        (!selector.address.empty() && device.address != selector.address)) {
      absl::StrAppend(&others, others.empty() ? "" : "; ", device.address, " ", device.product,
                      device.unreadable.empty() ? absl::StrCat(" serial ", device.serial)
                                                : absl::StrCat(" (", device.unreadable, ")"));
      continue;
    }
    if (found.has_value()) {
      return Error(absl::StatusCode::kFailedPrecondition, "DEVICE_AMBIGUOUS",
                   absl::StrCat("two FTDI devices", wanted, ": at ", devices[*found].address,
                                " and at ", device.address, "; say which by address"),
                   metadata);
    }
    found = i;
  }
  if (found.has_value()) return *found;
  return Error(absl::StatusCode::kUnavailable, "DEVICE_LOST",
               absl::StrCat("no FTDI device (0403:6001)", wanted, " is plugged in; there is ",
                            others.empty() ? "none" : others),
               metadata);
}

}  // namespace lightstage::dmx
