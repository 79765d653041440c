// What all device contracts share.
//
// Operations are asynchronous: they take a deadline on the rig's clock and a Completion, which the driver calls exactly once – before
// the call returns if the device is done at once, else later from any thread, never while holding a lock that the caller could
// need. If the device has not confirmed by the deadline the driver completes with DEADLINE_EXCEEDED; it never reports success that
// the device did not confirm. Errors carry a reason (base/status.h): DEVICE_SILENT, DEVICE_LOST, DEVICE_FAULT, OUT_OF_RANGE …
//
// Threads: methods of one device are called from one thread at a time, except those named "any thread". A driver whose
// hardware calls block runs them on a thread of its own.
// Lifetime: the destructor brings the device to its safe state (stopped, dark), completes what is outstanding with CANCELLED, and
// blocks until no callback is running.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>

#include "absl/functional/any_invocable.h"
#include "absl/status/statusor.h"
#include "base/async.h"
#include "base/clock.h"
#include "base/toml.h"
#include "optics/rig_geometry.h"

namespace lightstage {

struct DeviceIdentity {
  std::string name;    // its name in the rig file, e.g. "camera"
  std::string driver;  // e.g. "aravis"
  std::string model;   // vendor and model as the device says
  std::string serial;  // empty if it has none
};

// What a driver gets to open its device. Clock and geometry outlive the device.
struct DeviceContext {
  std::string name;
  Clock* clock = nullptr;
  const RigGeometry* geometry = nullptr;
};

// Opens a device: connects, reads what it is, and leaves it stopped and dark. May block up to 10 s.
template <class Device>
using DeviceOpener =
    absl::AnyInvocable<absl::StatusOr<std::unique_ptr<Device>>(const DeviceContext&)>;

// A driver, as daemon/app/builtin_drivers.cc lists it.
template <class Device>
struct Driver {
  // Reads the device's table strictly (errors go into the table) without touching a device. The opener is used only if the whole
  // document was right. A driver whose library was missing at build time records that as an error at "driver".
  absl::AnyInvocable<DeviceOpener<Device>(const TomlTable&) const> parse;
  // True if its devices live on the rig's clock alone, so that the rig may run on virtual time.
  bool on_virtual_time = false;
};

}  // namespace lightstage
