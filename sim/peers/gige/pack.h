// The packed pixel formats of GigE Vision cameras, as the Pixel Format Naming Convention and the GigE Vision specification draw them.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace lightstage::sim {

// "Mono12p" and its kin: sample k takes the bits from k · bits on of the stream, the lowest bit of a byte first.
std::vector<std::byte> PackLowestFirst(std::span<const uint16_t> samples, int bits);
// "Mono12Packed" and its kin, an even number of samples: upper 8 bits of the first, lower bits of both, upper 8 bits of the second.
std::vector<std::byte> PackGigE(std::span<const uint16_t> samples, int bits);

}  // namespace lightstage::sim
