// CAN interfaces of the kernel (SocketCAN). Documentation/networking/can.rst of the kernel; linux/can/error.h.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "drivers/canopen/can_port.h"

namespace lightstage::canopen {

// What an error frame of the kernel says; `id` with its flags as in struct can_frame.
struct CanError {
  std::optional<CanState> state;  // that the controller changed to
  std::string text;
};
CanError DecodeErrorFrame(uint32_t id, std::span<const uint8_t> data);

// A raw socket on `interface`, which must be up: its bit rate is the system's business. Receive times are the kernel's, put on `clock`.
// UNAVAILABLE / DEVICE_LOST if it is not there or down; FAILED_PRECONDITION / CAN_UNSUPPORTED if this kernel has no CAN.
absl::StatusOr<std::unique_ptr<CanPort>> OpenSocketCan(const std::string& interface, Clock& clock);

struct CanInterface {
  std::string name;
  bool up = false;
};
// By name. `directory` is /sys/class/net. INTERNAL / IO if it can not be read.
absl::StatusOr<std::vector<CanInterface>> ListCanInterfaces(
    const std::string& directory = "/sys/class/net");

}  // namespace lightstage::canopen
