// The reports to and from one HID device.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "base/clock.h"
#include "drivers/dlpc350/codec.h"

namespace lightstage::dlpc350 {

// One thread at a time. UNAVAILABLE / DEVICE_LOST once it is unplugged.
class HidPort {
 public:
  virtual ~HidPort() = default;

  virtual const std::string& serial() const = 0;
  virtual absl::Status Write(const Report& report) = 0;
  // The next report, as long as it came; nothing if none came within `patience`.
  virtual absl::StatusOr<std::vector<uint8_t>> Read(Duration patience) = 0;
};

// Opens the same device each time. NOT_FOUND / DEVICE_NOT_FOUND.
using HidOpener = std::function<absl::StatusOr<std::unique_ptr<HidPort>>()>;

struct HidDevice {
  std::string path, maker, product, serial;
};

inline constexpr uint16_t kVendor = 0x0451, kProduct = 0x6401;

// The DLPC350s on this machine, by hidapi.
absl::StatusOr<std::vector<HidDevice>> ListHidDevices();

// The one at `path`, else the one with `serial`, else the only one: FAILED_PRECONDITION / DEVICE_UNSUITABLE if there are several.
absl::StatusOr<std::unique_ptr<HidPort>> OpenHidDevice(const std::string& path,
                                                       const std::string& serial);

}  // namespace lightstage::dlpc350
