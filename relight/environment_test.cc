#include "relight/environment.h"

#include <cmath>
#include <numbers>

#include "base/status.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "relight/test_dataset.h"

namespace lightstage::relight {
namespace {

constexpr double kPi = std::numbers::pi;

EnvironmentMap Map(Image image) { return *EnvironmentMap::FromImage(std::move(image)); }

Dataset OpenSphere(const std::string& folder) {
  auto dataset = Dataset::Open(folder);
  EXPECT_TRUE(dataset.ok()) << dataset.status();
  return *std::move(dataset);
}

Relit RelightSphere(const Dataset& dataset, const EnvironmentMap& map, Angle rotate = Degrees(0)) {
  auto relit = RelightWithEnvironment(dataset, map, rotate);
  EXPECT_TRUE(relit.ok()) << relit.status();
  return *std::move(relit);
}

// Under a uniform upper hemisphere of radiance 1 a surface whose normal tilts by θ gets the irradiance π (1 + cos θ) / 2.
TEST(RelightWithEnvironment, LambertSphereUnderAUniformSkyIsTheClosedForm) {
  const std::string folder = TestFolder();
  WriteSphere(folder, StageDirections(32, 10), {0.8f, 0.4f, 0.2f});
  Relit relit = RelightSphere(OpenSphere(folder), Map(Image(64, 32, 1, 1.0f)));
  EXPECT_EQ(relit.image.channels(), 3);
  EXPECT_EQ(relit.images_used, 320);
  for (int y = 0; y < kSphereSize; ++y) {
    for (int x = 0; x < kSphereSize; ++x) {
      const Vec3 n = SphereNormal(x, y);
      const double irradiance = n.isZero() ? 0 : kPi * (1 + n.z()) / 2;
      // 320 lamps for the sky: within 0.5 % of the zenith's irradiance.
      EXPECT_NEAR(relit.image.at(x, y, 0), 0.8 * irradiance, 0.8 * 0.005 * kPi);
      EXPECT_NEAR(relit.image.at(x, y, 2), 0.2 * irradiance, 0.2 * 0.005 * kPi);
    }
  }
}

// A point-like sun straight above one of the lamps, in colour: the picture is that lamp's image times the sun's irradiance.
TEST(RelightWithEnvironment, OneBrightTexelPicksItsLamp) {
  const std::string folder = TestFolder();
  const auto directions = StageDirections(16, 4);
  WriteSphere(folder, directions, {1});
  Dataset dataset = OpenSphere(folder);
  Image image(256, 128, 3);
  // Azimuth 45°, tilt 33.75°: texel columns grow towards −azimuth from 180° at the left.
  const int x = 256 * (180 - 45) / 360, y = static_cast<int>(128 * 33.75 / 180);
  for (int c = 0; c < 3; ++c) image.at(x, y, c) = 100.0f * (c + 1);
  EnvironmentMap map = Map(std::move(image));
  for (double rotate : {0.0, 90.0, -45.0}) {
    Relit relit = RelightSphere(dataset, map, Degrees(rotate));
    const Vec3 lamp = DirectionFromAngles(Degrees(45 + rotate), Degrees(33.75));
    const BasisImage expected = SphereImage(lamp, 1, {1});
    for (int c = 0; c < 3; ++c) {
      const double irradiance = map.SolidAngle(y) * 100 * (c + 1);
      for (int p = 0; p < kSphereSize; ++p) {
        EXPECT_NEAR(relit.image.at(p, 10, c), irradiance * expected.pixels.at(p, 10, 0),
                    2e-3 * irradiance);
      }
    }
  }
}

TEST(RelightWithEnvironment, LevelsAndRepeatedDirectionsDoNotChangeThePicture) {
  const std::string folder = TestFolder();
  const auto directions = StageDirections(8, 4);
  WriteSphere(folder, directions, {1});
  EnvironmentMap sky = Map(Image(16, 8, 1, 1.0f));
  Relit plain = RelightSphere(OpenSphere(folder), sky);
  EXPECT_EQ(plain.image.channels(), 1);

  std::vector<ShotRecord> records;
  for (size_t i = 0; i < directions.size(); ++i) {
    const double level = i % 2 ? 0.5 : 1;
    records.push_back(SphereRecord(i, directions[i], level));
    WriteImage(folder, records.back(), SphereImage(directions[i], level, {1}));
  }
  records.push_back(SphereRecord(directions.size(), directions[3]));
  WriteImage(folder, records.back(), SphereImage(directions[3], 1, {1}));
  records.push_back(SphereRecord(directions.size() + 1, std::nullopt));
  WriteManifest(folder, records, 1);
  Relit other = RelightSphere(OpenSphere(folder), sky);
  EXPECT_EQ(other.images_used, 33);
  EXPECT_EQ(other.images_skipped, 1);
  for (size_t i = 0; i < plain.image.pixels().size(); ++i) {
    EXPECT_NEAR(other.image.pixels()[i], plain.image.pixels()[i], 4e-3);
  }
}

TEST(RelightWithEnvironment, SaysWhereTheCameraRangeWasExceeded) {
  const std::string folder = TestFolder();
  ShotRecord record = SphereRecord(0, Vec3::UnitX());
  BasisImage image = SphereImage(Vec3::UnitX(), 1, {1});
  for (int x = 0; x < kSphereSize; ++x) image.flags[4 * kSphereSize + x] = kAboveRange;
  WriteImage(folder, record, image);
  WriteManifest(folder, {record}, 1);
  Relit relit = RelightSphere(OpenSphere(folder), Map(Image(4, 2, 1, 1.0f)));
  EXPECT_DOUBLE_EQ(relit.above_range_share, 1.0 / kSphereSize);
}

TEST(RelightWithEnvironment, ErrorsNameTheFile) {
  const std::string folder = TestFolder();
  WriteSphere(folder, StageDirections(4, 2), {1});
  ASSERT_TRUE(PosixEnv().WriteFile(folder + "/basis_5.exr", "broken").ok());
  auto broken = RelightWithEnvironment(OpenSphere(folder), Map(Image(4, 2, 1, 1.0f)), Degrees(0));
  EXPECT_EQ(broken.status().code(), absl::StatusCode::kDataLoss);
  EXPECT_THAT(std::string(broken.status().message()), testing::HasSubstr("basis_5.exr"));

  WriteManifest(folder, {SphereRecord(0, std::nullopt)}, 1);
  auto none = RelightWithEnvironment(OpenSphere(folder), Map(Image(4, 2, 1, 1.0f)), Degrees(0));
  EXPECT_EQ(ErrorReason(none.status()), "NO_LIGHT_DIRECTIONS");
}

}  // namespace
}  // namespace lightstage::relight
