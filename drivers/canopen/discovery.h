// Which nodes are on a bus, found by reading objects that every node has.
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "drivers/api/registry.h"
#include "drivers/canopen/can_port.h"
#include "drivers/canopen/node.h"

namespace lightstage::canopen {

struct FoundNode {
  int node = 0;
  NodeIdentity identity;
};

// Reads 1000h of nodes 1 to 127, then 1018h and 1008h of those that answer within `patience`. Changes nothing. Must be the only SDO client on
// the bus: an answer does not say whose question it was.
absl::StatusOr<std::vector<FoundNode>> ScanNodes(CanPort& port, Clock& clock, Duration patience);

// For people, with lines of a rig file.
Discovered DescribeNode(const std::string& interface, const FoundNode& found);

}  // namespace lightstage::canopen
