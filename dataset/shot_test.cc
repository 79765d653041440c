#include "dataset/shot.h"

#include "base/status.h"
#include "gtest/gtest.h"

namespace lightstage {
namespace {

TEST(ShotTest, KindsHaveTheirNames) {
  for (ShotKind kind : {ShotKind::kBasis, ShotKind::kDark, ShotKind::kReference}) {
    EXPECT_EQ(ParseShotKind(ShotKindName(kind)).value(), kind);
  }
  EXPECT_STREQ(ShotKindName(ShotKind::kReference), "reference");
  EXPECT_EQ(ErrorReason(ParseShotKind("Basis").status()), "SHOT_KIND");
}

TEST(ShotTest, Describe) {
  Shot shot;
  shot.id = 12;
  shot.pose = {Degrees(45), Degrees(7.5)};
  shot.condition.lamps = {{7, 0.5}};
  EXPECT_EQ(DescribeShot(shot), "shot 12 (basis): lamp 7 at 0.5, azimuth 45, tilt 7.5");
  shot.kind = ShotKind::kDark;
  shot.condition.lamps.clear();
  EXPECT_EQ(DescribeShot(shot), "shot 12 (dark): dark, azimuth 45, tilt 7.5");
  shot.condition.lamps.resize(40);
  shot.condition.pattern = Pattern{.arrangement = PatternArrangement::kFull};
  EXPECT_EQ(DescribeShot(shot), "shot 12 (dark): 40 lamps, pattern full, azimuth 45, tilt 7.5");
}

}  // namespace
}  // namespace lightstage
