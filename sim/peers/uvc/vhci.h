// Plugs USB devices into this machine by the kernel's vhci-hcd: a port of its hub is given one end of a socket and believes that a device is
// at the other, which speaks USB/IP (usbip.h). As root; before: modprobe vhci-hcd.
#pragma once

#include <optional>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace lightstage::sim {

struct VhciPlug {
  int port = -1;
  int socket = -1;  // the device's end; the caller's
};

// A device of high speed, at `port` – so that it is the same one to those who know cameras by where they are plugged in – or at any
// that is free. UNAVAILABLE / PEER_NOT_STARTED, naming the file or what would help.
absl::StatusOr<VhciPlug> PlugIntoVhci(std::optional<int> port = {});

// Returns when the port is free again, which it soon is after the socket was closed. The same errors.
absl::Status AwaitVhciPort(int port);

// A port of high speed that is free – `port`, if given –, by the text of the file `status`.
std::optional<int> FreeVhciPort(std::string_view status, std::optional<int> port = {});

}  // namespace lightstage::sim
