#include "drivers/dmx/slots.h"

#include <cmath>

namespace lightstage::dmx {
namespace {

int StepOf(const ChannelMap& map, float level) {
  return static_cast<int>(std::lround(static_cast<double>(level) * map.steps()));
}

}  // namespace

std::vector<uint8_t> SlotsOf(const ChannelMap& map, std::span<const float> levels) {
  std::vector<uint8_t> slots(static_cast<size_t>(map.slots), 0);
  for (size_t lamp = 0; lamp < levels.size(); ++lamp) {
    const int step = StepOf(map, levels[lamp]);
    const auto at = static_cast<size_t>(map.first[lamp] - 1);
    if (map.bits == 16) {
      slots[at] = static_cast<uint8_t>(step >> 8);
      slots[at + 1] = static_cast<uint8_t>(step & 0xFF);
    } else {
      slots[at] = static_cast<uint8_t>(step);
    }
  }
  return slots;
}

std::vector<float> Quantised(const ChannelMap& map, std::span<const float> levels) {
  std::vector<float> taken;
  taken.reserve(levels.size());
  for (float level : levels) {
    taken.push_back(static_cast<float>(StepOf(map, level)) / static_cast<float>(map.steps()));
  }
  return taken;
}

}  // namespace lightstage::dmx
