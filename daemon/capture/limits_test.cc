#include "daemon/capture/limits.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "base/status.h"
#include "daemon/capture/test_rig.h"

namespace lightstage {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using ::testing::HasSubstr;

Shot GoodShot() {
  Shot shot;
  shot.id = 12;
  shot.pose = {Degrees(350), Degrees(45)};
  shot.condition.lamps = {{0, 1.0}, {39, 0.5}};
  shot.condition.pattern = Pattern{PatternArrangement::kSquare, PatternProfile::kBox, 16, 0, 3, 4};
  shot.exposures = {milliseconds(1), milliseconds(2)};
  return shot;
}

void ExpectRefused(const Shot& shot, const char* reason, const char* says,
                   const RigFacts& facts = TestRig()) {
  absl::Status status = CheckShot(shot, facts);
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << reason;
  EXPECT_EQ(ErrorReason(status), reason) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr(says));
  EXPECT_THAT(std::string(status.message()), HasSubstr("shot 12"));
}

TEST(CheckShot, TakesWhatIsInside) {
  EXPECT_EQ(CheckShot(GoodShot(), TestRig()), absl::OkStatus());
}

TEST(CheckShot, RefusesPoses) {
  Shot shot = GoodShot();
  shot.pose.azimuth = Degrees(std::nan(""));
  ExpectRefused(shot, "ANGLE_NOT_FINITE", "azimuth nan");
  shot.pose = {Degrees(0), Degrees(INFINITY)};
  ExpectRefused(shot, "ANGLE_NOT_FINITE", "tilt inf");
  shot.pose = {Degrees(360.5), Degrees(0)};
  ExpectRefused(shot, "AZIMUTH_LIMIT", "azimuth 360.5 deg is outside the rig's limits [-360, 360]");
  shot.pose = {Degrees(0), Degrees(90.01)};
  ExpectRefused(shot, "TILT_LIMIT", "[0, 90]");
  RigFacts facts = TestRig();
  facts.tilt->max = Degrees(80);
  shot.pose = {Degrees(0), Degrees(85)};
  ExpectRefused(shot, "AXIS_LIMIT", "tilt: target 85 deg", facts);
  facts.tilt.reset();
  ExpectRefused(shot, "AXIS_MISSING", "no tilt axis", facts);
  facts.turntable.reset();
  shot.pose = {Degrees(5), Degrees(0)};
  ExpectRefused(shot, "AXIS_MISSING", "no turntable", facts);
  shot.pose = {};
  EXPECT_TRUE(CheckShot(shot, facts).ok());
}

TEST(CheckShot, RefusesLamps) {
  Shot shot = GoodShot();
  shot.condition.lamps = {{40, 1.0}};
  ExpectRefused(shot, "LAMP_UNKNOWN", "lamp 40 does not exist: this rig has 40 lamps, 0 to 39");
  shot.condition.lamps = {{-1, 1.0}};
  ExpectRefused(shot, "LAMP_UNKNOWN", "lamp -1");
  for (double level : {-0.1, 1.5, std::nan("")}) {
    shot.condition.lamps = {{3, level}};
    ExpectRefused(shot, "LAMP_LEVEL", "lamp 3");
  }
  shot.condition.lamps = {{3, 1.0}, {4, 1.0}, {3, 0.5}};
  ExpectRefused(shot, "LAMP_DUPLICATE", "lamp 3");
  RigFacts facts = TestRig();
  facts.limits.max_lamps_on = 2;
  shot.condition.lamps = {{1, 1.0}, {2, 0.0}, {3, 0.1}};
  EXPECT_TRUE(CheckShot(shot, facts).ok()) << "a lamp at level 0 is off";
  shot.condition.lamps = {{1, 1.0}, {2, 0.2}, {3, 0.1}};
  ExpectRefused(shot, "LAMPS_ON_LIMIT", "3 lamps on at once: this rig allows 2", facts);
  facts.lamps.reset();
  ExpectRefused(shot, "LAMPS_MISSING", "no lamps", facts);
}

TEST(CheckShot, RefusesPatterns) {
  Shot shot = GoodShot();
  shot.condition.pattern->column = 16;
  ExpectRefused(shot, "PATTERN_INVALID", "16");
  shot.condition.pattern = Pattern{PatternArrangement::kSquare, PatternProfile::kBox, 769};
  ExpectRefused(shot, "GRID_TOO_FINE", "grid 769 is finer than the projector's 1024 x 768 pixels");
  RigFacts facts = TestRig();
  facts.projector.reset();
  ExpectRefused(shot, "PROJECTOR_MISSING", "no projector", facts);
}

TEST(CheckShot, RefusesExposures) {
  Shot shot = GoodShot();
  shot.exposures = {};
  ExpectRefused(shot, "EXPOSURES_EMPTY", "no exposure");
  shot.exposures = {Duration(0)};
  ExpectRefused(shot, "EXPOSURES_NOT_ASCENDING", "above 0");
  shot.exposures = {-milliseconds(1)};
  ExpectRefused(shot, "EXPOSURES_NOT_ASCENDING", "-1000 us");
  shot.exposures = {milliseconds(2), milliseconds(1)};
  ExpectRefused(shot, "EXPOSURES_NOT_ASCENDING", "exposure 1000 us follows 2000 us");
  shot.exposures = {milliseconds(2), milliseconds(2)};
  ExpectRefused(shot, "EXPOSURES_NOT_ASCENDING", "ascending");
  shot.exposures = {milliseconds(1), milliseconds(2), milliseconds(3), milliseconds(4),
                    milliseconds(5)};
  ExpectRefused(shot, "EXPOSURES_TOO_MANY", "5 exposures per shot: this rig allows 4");
  shot.exposures = {milliseconds(6000)};
  ExpectRefused(shot, "EXPOSURE_LIMIT", "exposure 6e+06 us: this rig allows at most 5e+06 us");
  shot.exposures = {microseconds(1)};
  ExpectRefused(shot, "CAMERA_EXPOSURE", "the camera takes 10 to 1e+07 us");
}

}  // namespace
}  // namespace lightstage
