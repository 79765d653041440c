#include "drivers/display/head.h"

#include <gtest/gtest.h>

namespace lightstage {
namespace {

constexpr int32_t kOne = 1 << 16;

Scanout Plain() {
  return {.width = 1280,
          .height = 800,
          .mode_width = 1280,
          .mode_height = 800,
          .transform = {kOne, 0, 0, 0, kOne, 0, 0, 0, kOne}};
}

TEST(Alteration, OnePixelForOneIsNone) { EXPECT_EQ(AlterationOf(Plain()), ""); }

TEST(Alteration, WhatComesBetweenIsNamed) {
  for (int rotation : {2, 4, 8, 1 | 16, 1 | 32}) {  // 90, 180, 270 degrees, in x, in y
    Scanout scanout = Plain();
    scanout.rotation = rotation;
    EXPECT_EQ(AlterationOf(scanout), "rotated or reflected") << rotation;
  }
  for (size_t i = 0; i < 9; ++i) {  // a scale, a shift, a keystone
    Scanout scanout = Plain();
    scanout.transform[i] += 400;
    EXPECT_EQ(AlterationOf(scanout), "scaled or transformed") << i;
  }
  Scanout scanout = Plain();
  scanout.mode_width = 1920;
  scanout.mode_height = 1080;
  EXPECT_EQ(AlterationOf(scanout), "scaled from 1280x800 to 1920x1080");
}

}  // namespace
}  // namespace lightstage
