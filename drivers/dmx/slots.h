// Lamps on a DMX512 universe: which slots a lamp has, and what levels look like there. Pure functions.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/clock.h"

namespace lightstage::dmx {

constexpr int kMinSlots = 24, kMaxSlots = 512;
constexpr uint8_t kStartCode = 0;  // of dimmer levels (ANSI E1.11, NULL START Code)

// So long this many slots take on the line: 11 bits of 4 µs each.
constexpr Duration LineTime(size_t slots) { return Duration(44000) * static_cast<int64_t>(slots); }

// What an Open DMX needs for one frame at least: break, mark after break and the slots; and how far apart breaks must be (ANSI E1.11: 92 µs, 12 µs
// and 1204 µs). The break is made by two requests over USB, which take longer than it must last.
constexpr Duration kBreak = std::chrono::microseconds(120);
constexpr Duration kMark = std::chrono::microseconds(20);
constexpr Duration kBreakToBreak = std::chrono::microseconds(1204);
constexpr Duration FrameTime(size_t slots) {
  return std::max(kBreakToBreak, kBreak + kMark + LineTime(slots + 1));
}

struct ChannelMap {
  std::vector<int> first;  // by lamp, its (coarse) channel, 1 … 512
  int bits = 8;            // 8, or 16: coarse, then fine in the channel after it
  int slots = kMaxSlots;   // of the universe

  int steps() const { return bits == 16 ? 65535 : 255; }
  int width() const { return bits / 8; }  // channels of a lamp
};

// The universe that shows `levels`, one per lamp, in [0,1]; channels of nobody are 0.
std::vector<uint8_t> SlotsOf(const ChannelMap& map, std::span<const float> levels);
// What it really shows: the nearest of the map's steps.
std::vector<float> Quantised(const ChannelMap& map, std::span<const float> levels);

}  // namespace lightstage::dmx
