#include "optics/environment_map.h"

#include <cmath>
#include <limits>
#include <numbers>

#include "base/status.h"
#include "gtest/gtest.h"

namespace lightstage {
namespace {

constexpr double kPi = std::numbers::pi;

EnvironmentMap Make(Image image) { return *EnvironmentMap::FromImage(std::move(image)); }

TEST(EnvironmentMap, SolidAnglesFillTheSphereExactly) {
  EnvironmentMap map = Make(Image(7, 5, 1, 1.0f));
  double sum = 0;
  for (int y = 0; y < 5; ++y) sum += 7 * map.SolidAngle(y);
  EXPECT_NEAR(sum, 4 * kPi, 1e-12);
  EXPECT_NEAR(map.SolidAngle(0), 2 * kPi / 7 * (1 - std::cos(kPi / 5)), 1e-14);
  EXPECT_NEAR(map.TotalPower()[2], 4 * kPi, 1e-6);
}

// ∫ max(cos θ, 0) dω = π.
TEST(EnvironmentMap, PowerOfACosineSky) {
  Image image(8, 512, 3);
  for (int y = 0; y < 256; ++y) {
    for (int x = 0; x < 8; ++x) image.at(x, y, 1) = std::cos((y + 0.5) / 512 * kPi);
  }
  Radiance power = Make(std::move(image)).TotalPower();
  EXPECT_EQ(power[0], 0);
  EXPECT_NEAR(power[1], kPi, 1e-4);
}

TEST(EnvironmentMap, LooksOutFromInside) {
  Image image(8, 4, 1);
  for (int y = 0; y < 4; ++y) {
    for (int x = 0; x < 8; ++x) image.at(x, y, 0) = 10 * y + x;
  }
  EnvironmentMap map = Make(std::move(image));
  auto at = [&](double azimuth, double tilt) {
    return map.Lookup(2 * DirectionFromAngles(Degrees(azimuth), Degrees(tilt)))[0];
  };
  EXPECT_EQ(at(1, 100), 23);     // left of the middle: a little counterclockwise
  EXPECT_EQ(at(-1, 100), 24);    // right of it
  EXPECT_EQ(at(90.1, 1), 1);     // +Y is left
  EXPECT_EQ(at(179, 179), 30);   // left edge
  EXPECT_EQ(at(-179, 179), 37);  // right edge
  EXPECT_EQ(map.Lookup(Vec3::UnitZ())[0], 4);
  EXPECT_EQ(map.Lookup(-Vec3::UnitZ())[0], 34);
  EXPECT_DOUBLE_EQ(map.AzimuthOfColumn(0).degrees(), 180);
  EXPECT_DOUBLE_EQ(map.AzimuthOfColumn(4).degrees(), 0);
  EXPECT_DOUBLE_EQ(map.TiltOfRow(4).degrees(), 180);
  // Every texel's centre is in the texel.
  for (int y = 0; y < 4; ++y) {
    for (int x = 0; x < 8; ++x) {
      Vec3 d = DirectionFromAngles(map.AzimuthOfColumn(x + 0.5), map.TiltOfRow(y + 0.5));
      EXPECT_EQ(map.Lookup(d)[0], 10 * y + x);
    }
  }
}

TEST(EnvironmentMap, RefusesWhatIsNoLight) {
  auto reason = [](Image image) {
    return ErrorReason(EnvironmentMap::FromImage(std::move(image)).status());
  };
  EXPECT_EQ(reason(Image()), "ENVIRONMENT_INVALID");
  EXPECT_EQ(reason(Image(4, 2, 2)), "ENVIRONMENT_INVALID");
  Image nan(4, 2, 3);
  nan.at(3, 1, 2) = std::numeric_limits<float>::quiet_NaN();
  absl::Status status = EnvironmentMap::FromImage(nan).status();
  EXPECT_NE(status.message().find("(3, 1)"), std::string::npos) << status;
}

}  // namespace
}  // namespace lightstage
