// The lamps at the end of a DMX512 line: what they make of the packets that reach them.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "sim/rig/world.h"

namespace lightstage::sim {

struct DmxFixtureOptions {
  std::vector<int> first_channels;  // by lamp of the world's brace, 1 … 512
  bool fine = false;                // two channels each, coarse and fine
  int slots = 512;                  // of a whole packet; a shorter one changes nothing
  Duration rise{}, fall{};          // what the light takes
};

// Not thread-safe; whoever feeds it has a lock.
class DmxFixtures {
 public:
  // `world` may be null.
  DmxFixtures(const DmxFixtureOptions& options, std::shared_ptr<World> world)
      : options_(options), world_(std::move(world)) {}

  // A packet with start code 0, whose last slot ended at `at`; times do not decrease.
  void Receive(std::span<const uint8_t> slots, TimePoint at);
  int packets() const { return packets_; }

 private:
  const DmxFixtureOptions options_;
  const std::shared_ptr<World> world_;  // shared: all devices of a rig are in one world
  int packets_ = 0;
};

}  // namespace lightstage::sim
