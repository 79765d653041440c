#include "sim/peers/dmx/fixtures.h"

namespace lightstage::sim {

void DmxFixtures::Receive(std::span<const uint8_t> slots, TimePoint at) {
  if (slots.size() < static_cast<size_t>(options_.slots)) return;
  ++packets_;
  std::vector<float> levels;
  for (int channel : options_.first_channels) {
    const uint8_t coarse = slots[static_cast<size_t>(channel) - 1];
    if (options_.fine) {
      const int both = coarse * 256 + slots[static_cast<size_t>(channel)];
      levels.push_back(static_cast<float>(both) / 65535.0f);
    } else {
      levels.push_back(static_cast<float>(coarse) / 255.0f);
    }
  }
  if (world_ != nullptr) world_->RampLamps(at, options_.rise, options_.fall, levels);
}

}  // namespace lightstage::sim
