// A simulated CiA 402 drive that turns an axis of the simulated world.
#pragma once

#include <memory>
#include <optional>

#include "sim/peers/canopen/peer_node.h"
#include "sim/rig/world.h"

namespace lightstage::sim {

struct DriveOptions {
  PeerIdentity identity{.node = 5, .device_type = 0x00020192, .name = "lightstaged drive"};
  AxisRole role = AxisRole::kTurntable;
  double units_per_turn = 36000;  // of position; velocity and acceleration are these per s and s²
  double home_deg = 0;            // where its home switch is in the world
  // Before it is homed it counts from so far beside the switch, as a drive without absolute encoder does.
  double lost_deg = 37.5;
  std::optional<std::pair<int32_t, int32_t>> software_limits;  // 607Dh
  bool has_abort_option = true;                                // 6007h
  bool has_pdo = true;                                         // 1800h, 1A00h
  // Mode 3, its bit in 6502h, and what a drive that only positions need not have: 606Ch, 6084h, 60FFh.
  bool has_velocity_mode = true;
};

class CanopenDrive {
 public:
  // The world must be on real time.
  CanopenDrive(std::unique_ptr<canopen::CanPort> port, const DriveOptions& options,
               const std::shared_ptr<World>& world);
  ~CanopenDrive();

  PeerNode& node() { return *node_; }

  // ---- Faults

  // So many set-points are neither taken nor acknowledged.
  void LoseSetpoints(int count);
  // Fails: emergency, braking, state fault with this error code. If `stays`, resetting does not help.
  void Fail(uint16_t error_code, bool stays = false);
  void FailNextHoming();
  void SetFollowingError(bool error);
  void SetSlips(bool slips);
  // Something holds the axis where it is, for good; the drive goes on trying.
  void Jam();
  // Its enable input goes off: power goes at once.
  void CutPower();
  uint16_t statusword();

 private:
  class Profile;
  const std::unique_ptr<Profile> profile_;
  const std::unique_ptr<PeerNode> node_;
};

}  // namespace lightstage::sim
