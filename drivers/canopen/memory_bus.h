// A CAN bus within this process, for tests and simulation: what one port sends all others receive, in one order. Any thread.
#pragma once

#include <memory>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "base/mutex.h"
#include "drivers/canopen/can_port.h"

namespace lightstage::canopen {

class MemoryBus {
 public:
  explicit MemoryBus(Clock& clock);  // outlives the bus and its ports
  ~MemoryBus();

  // Ports may outlive the bus object; they share its wire.
  std::unique_ptr<CanPort> Attach();

  // What the controller of one end changes to. While it is bus-off nothing goes in or out there; kActive restarts it.
  void SetState(CanPort& port, CanState state);
  // The same for all ends, and those attached from now on.
  void SetState(CanState state);
  // The interface goes: ports of now are of no more use, and Attach() gives none that are, until it is back.
  void SetPresent(bool present);
  // Frames sent so far by any port, oldest first; at most the last 4096.
  std::vector<CanFrame> Sent() const;

 private:
  class Port;
  struct Wire;
  std::shared_ptr<Wire> wire_;  // shared: with the ports, which may outlive the bus
};

}  // namespace lightstage::canopen
