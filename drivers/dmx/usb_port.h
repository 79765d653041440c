// USB as this driver needs it: one interface with one bulk endpoint each way. libusb is one implementation (libusb_bus.h), the simulated
// widgets of sim/peers/dmx are another.
//
// Errors, of everything here: UNAVAILABLE / DEVICE_LOST if the device is not there any more or the bus does not reach it; DEADLINE_EXCEEDED /
// DEVICE_SILENT if it took or gave nothing in time; FAILED_PRECONDITION / DEVICE_FAULT if it refused the request.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "base/clock.h"
#include "base/status.h"

namespace lightstage::dmx {

// What a device says of itself.
struct UsbIdentity {
  std::string
      address;  // where it is plugged in, as Linux names it: bus-port[.port …], e.g. "1-2.3"
  std::string manufacturer, product, serial;  // empty if it has none, or if `unreadable` is not
  std::string unreadable;                     // why its strings could not be read
};

// Which device: all that is not empty must match.
struct UsbSelector {
  std::string serial, address;
};

// A control request without data, or with data from the device.
struct UsbRequest {
  uint8_t type = 0;     // bmRequestType
  uint8_t request = 0;  // bRequest
  uint16_t value = 0, index = 0;
};

// An open device, whose interface is ours until it is destroyed. For one thread at a time. Destroying it does not need the device.
class UsbPort {
 public:
  virtual ~UsbPort() = default;
  virtual const UsbIdentity& identity() const = 0;

  virtual absl::Status Control(const UsbRequest& request, Duration timeout) = 0;
  // Fills `data`: how many bytes came.
  virtual absl::StatusOr<size_t> ControlIn(const UsbRequest& request, std::span<uint8_t> data,
                                           Duration timeout) = 0;
  // How many bytes the device took: fewer than all is for the caller to judge.
  virtual absl::StatusOr<size_t> BulkOut(std::span<const uint8_t> data, Duration timeout) = 0;
  // `data` is a whole number of packets (kFtdiPacket). How many bytes came; 0 if none did in time, which is no error.
  virtual absl::StatusOr<size_t> BulkIn(std::span<uint8_t> data, Duration timeout) = 0;
};

class UsbBus {
 public:
  virtual ~UsbBus() = default;

  // The FTDI chips (0403:6001) that are there now.
  virtual absl::StatusOr<std::vector<UsbIdentity>> List() = 0;

  // Takes the device from the kernel's driver. UNAVAILABLE / DEVICE_LOST if there is none such now; FAILED_PRECONDITION / DEVICE_AMBIGUOUS if
  // there are several; FAILED_PRECONDITION / DEVICE_BUSY if another program has it; PERMISSION_DENIED / DEVICE_ACCESS.
  virtual absl::StatusOr<std::unique_ptr<UsbPort>> Open(const UsbSelector& selector) = 0;
};

// The device that `selector` means, as Open() must choose it.
absl::StatusOr<size_t> SelectDevice(std::span<const UsbIdentity> devices,
                                    const UsbSelector& selector);

}  // namespace lightstage::dmx
