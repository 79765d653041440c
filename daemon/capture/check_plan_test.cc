#include "daemon/capture/check_plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "base/status.h"
#include "daemon/capture/test_rig.h"

namespace lightstage {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

LightStagePlan SmallStage() { return {EvenAzimuths(4, Degrees(180)), AllLamps(3)}; }
Projector4dPlan SmallProjector() {
  return {CellCentredTilts(2), EvenAzimuths(4, Degrees(360)), 16, 2};
}

void ExpectRefused(const Plan& plan, const char* reason, const char* says = "",
                   const RigFacts& facts = TestRig()) {
  absl::Status status = ResolvePlan(plan, facts).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << reason;
  EXPECT_EQ(ErrorReason(status), reason) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr(says));
}

TEST(ResolvePlan, FillsWhatIsOpen) {
  auto stage = ResolvePlan({{}, SmallStage()}, TestRig());
  ASSERT_TRUE(stage.ok()) << stage.status();
  EXPECT_THAT(stage->plan.common.exposures, ElementsAre(milliseconds(1), milliseconds(8)));
  EXPECT_EQ(std::get<LightStagePlan>(stage->plan.kind).tilt, Degrees(0));
  EXPECT_THAT(stage->notes, IsEmpty());
  auto projector = ResolvePlan({{}, SmallProjector()}, TestRig());
  ASSERT_TRUE(projector.ok()) << projector.status();
  EXPECT_EQ(std::get<Projector4dPlan>(projector->plan.kind).order, AxisOrder::kTiltOutside);
}

TEST(ResolvePlan, RefusesEmptyLists) {
  LightStagePlan stage = SmallStage();
  stage.azimuths = {};
  ExpectRefused({{}, stage}, "AZIMUTHS_EMPTY");
  stage = SmallStage();
  stage.lamps = {};
  ExpectRefused({{}, stage}, "LAMPS_EMPTY");
  Projector4dPlan projector = SmallProjector();
  projector.azimuths = {};
  ExpectRefused({{}, projector}, "AZIMUTHS_EMPTY");
  projector = SmallProjector();
  projector.tilts = {};
  ExpectRefused({{}, projector}, "TILTS_EMPTY");
}

TEST(ResolvePlan, RefusesDuplicates) {
  LightStagePlan stage = SmallStage();
  stage.azimuths = {Degrees(10), Degrees(20), Degrees(10)};
  ExpectRefused({{}, stage}, "AZIMUTH_DUPLICATE", "azimuth 10 deg is given twice");
  stage.azimuths = {Degrees(-350), Degrees(10)};
  ExpectRefused({{}, stage}, "AZIMUTH_DUPLICATE");
  stage.azimuths = {Degrees(1e-8), Degrees(360)};
  ExpectRefused({{}, stage}, "AZIMUTH_DUPLICATE");
  stage.azimuths = {Degrees(-1e-8), Degrees(0)};
  ExpectRefused({{}, stage}, "AZIMUTH_DUPLICATE");
  stage = SmallStage();
  stage.lamps = {5, 1, 5};
  ExpectRefused({{}, stage}, "LAMP_DUPLICATE", "lamp 5 is given twice");
  Projector4dPlan projector = SmallProjector();
  projector.tilts = {Degrees(45), Degrees(45)};
  ExpectRefused({{}, projector}, "TILT_DUPLICATE", "tilt 45 deg");
}

TEST(ResolvePlan, RefusesWhatTheRigCannotDo) {
  LightStagePlan stage = SmallStage();
  stage.azimuths = {Degrees(0), Degrees(std::nan(""))};
  ExpectRefused({{}, stage}, "ANGLE_NOT_FINITE");
  stage.azimuths = {Degrees(0), Degrees(400)};
  ExpectRefused({{}, stage}, "AZIMUTH_LIMIT");
  stage = SmallStage();
  stage.tilt = Degrees(-5);
  ExpectRefused({{}, stage}, "TILT_LIMIT");
  stage = SmallStage();
  stage.lamps = {0, 40};
  ExpectRefused({{}, stage}, "LAMP_UNKNOWN", "lamp 40");
  stage = SmallStage();
  for (double level : {-0.5, 0.0, 1.01, std::nan("")}) {
    stage.level = level;
    ExpectRefused({{}, stage}, "LAMP_LEVEL");
  }
  RigFacts facts = TestRig();
  facts.lamps.reset();
  ExpectRefused({{}, SmallStage()}, "LAMPS_MISSING", "", facts);

  Projector4dPlan projector = SmallProjector();
  projector.tilts = {Degrees(45), Degrees(95)};
  ExpectRefused({{}, projector}, "TILT_LIMIT");
  for (int grid : {-3, 0, 2000}) {
    projector = SmallProjector();
    projector.grid = grid;
    ExpectRefused({{}, projector}, "PATTERN_INVALID");
  }
  projector.grid = 1000;
  ExpectRefused({{}, projector}, "GRID_TOO_FINE");
  for (int influence : {-1, 16}) {
    projector = SmallProjector();
    projector.influence = influence;
    ExpectRefused({{}, projector}, "PATTERN_INVALID");
  }
  facts = TestRig();
  facts.projector.reset();
  ExpectRefused({{}, SmallProjector()}, "PROJECTOR_MISSING", "", facts);
}

TEST(ResolvePlan, RefusesBadCommonParts) {
  Plan plan{{}, SmallStage()};
  plan.common.dark_every = -1;
  ExpectRefused(plan, "FRAME_INTERVAL", "dark_every -1");
  plan.common.dark_every = 0;
  plan.common.reference_every = -7;
  ExpectRefused(plan, "FRAME_INTERVAL", "reference_every -7");
  plan.common = {};
  plan.common.exposures = {milliseconds(2), milliseconds(1)};
  ExpectRefused(plan, "EXPOSURES_NOT_ASCENDING");
  plan.common.exposures = {std::chrono::seconds(20)};
  ExpectRefused(plan, "EXPOSURE_LIMIT");
  plan.common.exposures = {microseconds(3)};
  ExpectRefused(plan, "CAMERA_EXPOSURE");
}

TEST(ResolvePlan, RefusesMoreThanAnyoneCaptures) {
  Projector4dPlan projector{CellCentredTilts(7), EvenAzimuths(32, Degrees(360)), 512, {}};
  ExpectRefused({{}, projector}, "PLAN_TOO_LARGE", "58720256");
}

TEST(ResolvePlan, LampsOneAfterAnotherAreNotAtOnce) {
  RigFacts facts = TestRig();
  facts.limits.max_lamps_on = 1;
  Plan plan{{}, SmallStage()};
  EXPECT_TRUE(ResolvePlan(plan, facts).ok());
  plan.common.reference_every = 10;
  ExpectRefused(plan, "LAMPS_ON_LIMIT", "reference frames light all lamps", facts);
}

TEST(ResolvePlan, ReportsAdjustedExposures) {
  Plan plan{{}, SmallStage()};
  plan.common.exposures = {microseconds(100), microseconds(998)};
  auto resolved = ResolvePlan(plan, TestRig());
  ASSERT_TRUE(resolved.ok()) << resolved.status();
  EXPECT_THAT(resolved->plan.common.exposures, ElementsAre(microseconds(100), microseconds(1000)));
  EXPECT_THAT(resolved->notes, ElementsAre("exposure adjusted"));
  auto again = ResolvePlan(resolved->plan, TestRig());
  EXPECT_THAT(again->notes, IsEmpty());
  // Both become 100 us.
  plan.common.exposures = {microseconds(98), microseconds(102)};
  ExpectRefused(plan, "EXPOSURES_NOT_ASCENDING");
}

TEST(ResolvePlan, NotesWhatCouldBeHadCheaper) {
  Projector4dPlan projector = SmallProjector();
  projector.influence = 6;
  EXPECT_THAT(ResolvePlan({{}, projector}, TestRig())->notes, IsEmpty());
  projector.influence = 7;
  auto resolved = ResolvePlan({{}, projector}, TestRig());
  ASSERT_TRUE(resolved.ok()) << "allowed, if it is wanted";
  EXPECT_THAT(resolved->notes, ElementsAre(HasSubstr("takes 256 patterns per position")));
  projector = SmallProjector();
  projector.tilts = {Degrees(0), Degrees(45)};
  EXPECT_THAT(ResolvePlan({{}, projector}, TestRig())->notes, ElementsAre(HasSubstr("zenith")));
  LightStagePlan stage = SmallStage();
  stage.level = 0.5;
  RigFacts facts = TestRig();
  facts.lamps->steps = 255;
  EXPECT_THAT(ResolvePlan({{}, stage}, facts)->notes, ElementsAre(HasSubstr("take 0.502")));
}

}  // namespace
}  // namespace lightstage
