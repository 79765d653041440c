// A simulated DLPC350 as a USB HID device (0451:6401) of this machine, through the kernel's uhid: whatever speaks hidraw finds it.
#pragma once

#include <memory>
#include <string>
#include <thread>

#include "absl/status/statusor.h"
#include "base/clock.h"
#include "sim/peers/dlpc350/device.h"

namespace lightstage::sim {

class UhidDevice {
 public:
  // Returns when the kernel has taken it and its hidraw node is there. UNAVAILABLE / PEER_NOT_STARTED, naming /dev/uhid or what it waits for.
  // `device` outlives it.
  static absl::StatusOr<std::unique_ptr<UhidDevice>> Plug(Dlpc350Device& device,
                                                          const std::string& serial);
  ~UhidDevice();  // unplugs it
  UhidDevice(const UhidDevice&) = delete;
  UhidDevice& operator=(const UhidDevice&) = delete;

 private:
  UhidDevice(Dlpc350Device& device, int uhid, int quit)
      : device_(device), uhid_(uhid), quit_(quit) {}
  void Run();
  void SendReplies();

  Dlpc350Device& device_;
  const int uhid_, quit_;  // an eventfd
  std::thread thread_;
};

}  // namespace lightstage::sim
