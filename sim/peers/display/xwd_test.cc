#include "sim/peers/display/xwd.h"

#include "gtest/gtest.h"

namespace lightstage {
namespace {

TEST(Xwd, WhatIsNoPictureIsRefused) {
  std::vector<uint8_t> file(100 + 2 * 8, 0);
  auto set = [&](int field, uint32_t value) {
    for (int i = 0; i < 4; ++i) file[field * 4 + i] = static_cast<uint8_t>(value >> (24 - 8 * i));
  };
  set(0, 100);
  set(1, 7);
  set(2, 2);
  set(4, 2);
  set(5, 2);
  set(11, 32);
  set(12, 8);
  set(14, 0xff0000);
  set(15, 0xff00);
  set(16, 0xff);
  file[100] = 3;  // blue of the first pixel
  ASSERT_TRUE(ParseXwd(file).ok()) << ParseXwd(file).status();
  EXPECT_EQ(ParseXwd(file)->pixels[0], 3u);
  for (size_t size = 0; size < file.size(); ++size) {
    EXPECT_FALSE(ParseXwd(std::span(file).first(size)).ok()) << size;
  }
  set(5, 0xffffffff);
  EXPECT_FALSE(ParseXwd(file).ok());
}

}  // namespace
}  // namespace lightstage
