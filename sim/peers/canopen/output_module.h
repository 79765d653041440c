// A simulated CiA 401 output module on which the lamps of the simulated world hang.
#pragma once

#include <memory>
#include <vector>

#include "sim/peers/canopen/peer_node.h"
#include "sim/rig/world.h"

namespace lightstage::sim {

struct OutputModuleOptions {
  PeerIdentity identity{.node = 9, .device_type = 0x00020191, .name = "lightstaged outputs"};
  bool analogue = false;
  int first_output = 0;        // that lamp 0 hangs on
  int outputs = 16;            // all; digital: a multiple of 8
  bool has_error_mode = true;  // 6206h, 6207h; 6443h, 6444h
  Duration rise{};
};

class CanopenOutputModule {
 public:
  // The world must be on real time.
  CanopenOutputModule(std::unique_ptr<canopen::CanPort> port, const OutputModuleOptions& options,
                      const std::shared_ptr<World>& world);
  ~CanopenOutputModule();

  PeerNode& node() { return *node_; }

  // Fault: writes are confirmed and not done.
  void IgnoreWrites(bool ignore);

 private:
  class Profile;
  const std::unique_ptr<Profile> profile_;
  const std::unique_ptr<PeerNode> node_;
};

}  // namespace lightstage::sim
