#include "relight/studio_map.h"

#include "gtest/gtest.h"
#include "optics/environment_map.h"

namespace lightstage::relight {
namespace {

TEST(StudioMap, LightsAreWhereTheHeaderSays) {
  auto map = EnvironmentMap::FromImage(StudioMap(256));
  ASSERT_TRUE(map.ok()) << map.status();
  auto at = [&](double azimuth, double tilt) {
    return map->Lookup(DirectionFromAngles(Degrees(azimuth), Degrees(tilt)));
  };
  const Radiance room = at(-120, 60), window = at(30, 40), lamp = at(-65, 50), strip = at(180, 60);
  EXPECT_GT(window[2], window[0]);
  EXPECT_GT(window[1], 10 * room[1]);
  EXPECT_GT(lamp[0], lamp[2]);
  EXPECT_GT(lamp[1], 300 * room[1]);
  EXPECT_GT(strip[2], 3 * strip[0]);
}

TEST(StudioMap, HoldsTheSameLightAtEveryResolution) {
  const Radiance fine = EnvironmentMap::FromImage(StudioMap(512))->TotalPower();
  const Radiance coarse = EnvironmentMap::FromImage(StudioMap(64))->TotalPower();
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(coarse[c] / fine[c], 1, 0.03);
}

}  // namespace
}  // namespace lightstage::relight
