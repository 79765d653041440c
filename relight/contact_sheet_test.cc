#include "relight/contact_sheet.h"

#include <algorithm>
#include <random>
#include <set>

#include "gtest/gtest.h"
#include "relight/test_dataset.h"

namespace lightstage::relight {
namespace {

std::vector<ShotRecord> Records(const std::vector<Vec3>& directions) {
  std::vector<ShotRecord> out;
  for (const Vec3& d : directions) out.push_back(SphereRecord(out.size(), d));
  return out;
}

TEST(LayOut, TheLightStageIs32By10) {
  // In an order of its own, and with the small errors of a real turntable.
  auto directions = StageDirections(64, 20);
  std::mt19937 random(1);
  std::shuffle(directions.begin(), directions.end(), random);
  for (Vec3& d : directions) {
    d = RotateAboutZ(d, Degrees(std::uniform_real_distribution<double>(-0.04, 0.04)(random)));
  }
  const auto records = Records(directions);
  SheetLayout layout = LayOut(records);
  EXPECT_TRUE(layout.regular);
  EXPECT_EQ(layout.columns, 32);
  EXPECT_EQ(layout.rows, 10);
  ASSERT_EQ(layout.images.size(), 320u);
  for (int r = 0; r < 10; ++r) {
    for (int c = 0; c < 32; ++c) {
      AzimuthTilt angles = AnglesOfDirection(*records[layout.images[r * 32 + c]].direction);
      EXPECT_NEAR(angles.tilt.degrees(), 2.25 + 9 * r, 1e-6);
      // The first column's azimuths scatter about 0°.
      EXPECT_NEAR(WrapTurn(angles.azimuth - Degrees(11.25 * c) + Degrees(1)).degrees(), 1, 0.05);
    }
  }
}

TEST(LayOut, SmallGridsAreShownWhole) {
  SheetLayout layout = LayOut(Records(StageDirections(6, 3)));
  EXPECT_TRUE(layout.regular);
  EXPECT_EQ(layout.columns, 6);
  EXPECT_EQ(layout.rows, 3);
  EXPECT_EQ(std::set<size_t>(layout.images.begin(), layout.images.end()).size(), 18u);
}

TEST(LayOut, FreeDirectionsRunFromTheZenithDown) {
  std::vector<Vec3> directions;
  std::mt19937 random(2);
  std::uniform_real_distribution<double> uniform(0, 1);
  for (int i = 0; i < 450; ++i) {
    directions.push_back(
        DirectionFromAngles(Degrees(360 * uniform(random)), Degrees(90 * uniform(random))));
  }
  SheetLayout layout = LayOut(Records(directions));
  EXPECT_FALSE(layout.regular);
  EXPECT_EQ(layout.rows, 10);
  EXPECT_EQ(layout.columns, 32);
  ASSERT_EQ(layout.images.size(), 320u);
  EXPECT_EQ(std::set<size_t>(layout.images.begin(), layout.images.end()).size(), 320u);
  double above = -1;
  for (int r = 0; r < layout.rows; ++r) {
    double mean = 0;
    for (int c = 0; c < layout.columns; ++c) {
      mean += AnglesOfDirection(directions[layout.images[r * 32 + c]]).tilt.degrees() / 32;
    }
    EXPECT_GT(mean, above);
    above = mean;
  }
  EXPECT_EQ(LayOut(Records({Vec3::UnitX()})).images, std::vector<size_t>{0});
}

TEST(LayOut, OneImagePerDirectionTheBrightest) {
  auto records = Records({Vec3::UnitX(), Vec3::UnitX(), Vec3::UnitY(), Vec3::UnitX()});
  records[1].checks.mean = 5;
  SheetLayout layout = LayOut(records);
  EXPECT_EQ(layout.images, (std::vector<size_t>{1, 2}));
}

TEST(LayOut, WithoutDirectionsItIsTheOrderOfTaking) {
  std::vector<ShotRecord> records(700);
  SheetLayout layout = LayOut(records);
  EXPECT_EQ(layout.images.size(), 320u);
  EXPECT_TRUE(std::is_sorted(layout.images.begin(), layout.images.end()));
}

TEST(MakeContactSheet, PutsThumbnailsInTheirPlaces) {
  const std::string folder = TestFolder();
  WriteSphere(folder, StageDirections(4, 2), {1, 1, 1});
  auto dataset = Dataset::Open(folder);
  ASSERT_TRUE(dataset.ok()) << dataset.status();
  SheetLayout layout = LayOut(dataset->basis());
  auto sheet = MakeContactSheet(*dataset, layout, 8);  // 32 → 8: means of 4×4
  ASSERT_TRUE(sheet.ok()) << sheet.status();
  EXPECT_EQ(sheet->width(), 2 + 4 * 10);
  EXPECT_EQ(sheet->height(), 2 + 2 * 10);
  for (int r = 0; r < 2; ++r) {
    for (int c = 0; c < 4; ++c) {
      const Vec3 light = DirectionFromAngles(Degrees(90 * c), Degrees(22.5 + 45 * r));
      const BasisImage image = SphereImage(light, 1, {1});
      double mean = 0;
      for (int i = 0; i < 16; ++i) mean += image.pixels.at(12 + i % 4, 8 + i / 4, 0) / 16;
      EXPECT_NEAR(sheet->at(2 + 10 * c + 3, 2 + 10 * r + 2, 1), mean, 1e-3);
    }
  }
  EXPECT_EQ(sheet->at(0, 0, 0), 0);  // the gap
}

}  // namespace
}  // namespace lightstage::relight
