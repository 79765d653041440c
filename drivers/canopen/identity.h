// Whether a node is the one that the rig file means.
#pragma once

#include <optional>

#include "absl/status/status.h"
#include "drivers/api/device.h"
#include "drivers/canopen/node.h"
#include "drivers/canopen/options.h"

namespace lightstage::canopen {

// `profile`: of CiA, e.g. 402. `before`: what it was when it was connected the last time. FAILED_PRECONDITION / DEVICE_UNSUITABLE naming what
// answers and what should.
absl::Status CheckIdentity(const Node& node, const NodeOptions& options,
                           const NodeIdentity& identity, uint16_t profile,
                           const std::optional<NodeIdentity>& before);

// Model and serial number for people; name and driver are left empty.
DeviceIdentity Describe(const NodeIdentity& identity);

// "a CiA 402 drive (device type 00020192h) of vendor 0000019Ah, product …": what answers.
std::string IdentityText(const NodeIdentity& identity);

}  // namespace lightstage::canopen
