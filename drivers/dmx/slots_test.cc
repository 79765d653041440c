#include "drivers/dmx/slots.h"

#include <gtest/gtest.h>

#include <numeric>

namespace lightstage::dmx {
namespace {

TEST(Slots, EightBitsAreOneChannel) {
  const ChannelMap map{.first = {1, 4, 24}, .bits = 8, .slots = 24};
  const std::vector<float> levels = {1.0f, 0.5f, 1.0f / 255};
  const std::vector<uint8_t> slots = SlotsOf(map, levels);
  ASSERT_EQ(slots.size(), 24u);
  EXPECT_EQ(slots[0], 255);
  EXPECT_EQ(slots[3], 128);
  EXPECT_EQ(slots[23], 1);
  EXPECT_EQ(std::accumulate(slots.begin(), slots.end(), 0), 255 + 128 + 1);
  EXPECT_EQ(Quantised(map, levels), (std::vector<float>{1.0f, 128 / 255.0f, 1 / 255.0f}));
}

TEST(Slots, SixteenBitsAreCoarseThenFine) {
  const ChannelMap map{.first = {3, 511}, .bits = 16, .slots = 512};
  const std::vector<float> levels = {0x1234 / 65535.0f, 1.0f};
  const std::vector<uint8_t> slots = SlotsOf(map, levels);
  ASSERT_EQ(slots.size(), 512u);
  EXPECT_EQ(slots[2], 0x12);
  EXPECT_EQ(slots[3], 0x34);
  EXPECT_EQ(slots[510], 0xFF);
  EXPECT_EQ(slots[511], 0xFF);
  EXPECT_EQ(Quantised(map, levels), levels);
}

TEST(Slots, DarkAndFullAreExact) {
  for (int bits : {8, 16}) {
    const ChannelMap map{.first = {1, 5}, .bits = bits, .slots = 24};
    const std::vector<float> levels = {0.0f, 1.0f};
    EXPECT_EQ(Quantised(map, levels), levels);
    EXPECT_EQ(SlotsOf(map, levels)[0], 0);
  }
}

// ANSI E1.11: a packet of 512 slots and a start code takes 22.6 ms, so that at most 44 go in a second.
TEST(Slots, LineTimeIsThatOf250Kilobaud) {
  EXPECT_EQ(LineTime(1), std::chrono::microseconds(44));
  EXPECT_EQ(LineTime(513), std::chrono::microseconds(22572));
}

}  // namespace
}  // namespace lightstage::dmx
