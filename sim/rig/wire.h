// Where a peer's wire is: in a device's table of the rig file,
//
//   [….peer]
//   wire = "kernel"      # the machine's bus, as for a real device; the default
//   wire = "process"     # one within this process, in place of the kernel's: for machines that have no such bus
#pragma once

#include "base/toml.h"

namespace lightstage::sim {

inline bool ParseWireIsKernel(const TomlTable& peer) {
  return peer.OneOf("wire", {"kernel", "process"}, "kernel") == "kernel";
}

}  // namespace lightstage::sim
