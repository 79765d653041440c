#include "sim/peers/gige/pack.h"

namespace lightstage::sim {

std::vector<std::byte> PackLowestFirst(std::span<const uint16_t> samples, int bits) {
  std::vector<std::byte> out;
  uint32_t pending = 0;  // bits that do not make a byte yet
  int count = 0;
  for (uint16_t sample : samples) {
    pending |= static_cast<uint32_t>(sample) << count;
    for (count += bits; count >= 8; count -= 8, pending >>= 8) {
      out.push_back(static_cast<std::byte>(pending & 0xff));
    }
  }
  if (count > 0) out.push_back(static_cast<std::byte>(pending));
  return out;
}

std::vector<std::byte> PackGigE(std::span<const uint16_t> samples, int bits) {
  std::vector<std::byte> out;
  const int low = bits - 8;
  const unsigned mask = (1u << low) - 1;
  for (size_t i = 0; i + 1 < samples.size(); i += 2) {
    out.push_back(static_cast<std::byte>(samples[i] >> low));
    out.push_back(static_cast<std::byte>((samples[i + 1] & mask) << 4 | (samples[i] & mask)));
    out.push_back(static_cast<std::byte>(samples[i + 1] >> low));
  }
  return out;
}

}  // namespace lightstage::sim
