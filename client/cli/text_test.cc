#include "client/cli/text.h"

#include <cmath>

#include "base/status.h"
#include "client/cli/messages.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace lightstage::client {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

TEST(BytesText, UsesBinaryUnits) {
  EXPECT_EQ(BytesText(0), "0 B");
  EXPECT_EQ(BytesText(1023), "1023 B");
  EXPECT_EQ(BytesText(1024), "1.0 KiB");
  EXPECT_EQ(BytesText((int64_t{1} << 20) - 1), "1.0 MiB");  // not 1024.0 KiB
  EXPECT_EQ(BytesText(int64_t{13} << 30), "13.0 GiB");
}

TEST(DurationText, CountsHoursWithoutEnd) {
  EXPECT_EQ(DurationText(0), "0:00:00");
  EXPECT_EQ(DurationText(3723.4), "1:02:03");
  EXPECT_EQ(DurationText(59.6), "0:01:00");
  EXPECT_EQ(DurationText(100 * 3600), "100:00:00");
  EXPECT_EQ(DurationText(NAN), "?");
  EXPECT_EQ(DurationText(-1), "?");
}

TEST(NumberText, LeavesOutWhatIsZero) {
  EXPECT_EQ(NumberText(33.75), "33.75");
  EXPECT_EQ(NumberText(30), "30");
  EXPECT_EQ(NumberText(100, 0), "100");
  EXPECT_EQ(NumberText(-0.0001), "0");
  EXPECT_EQ(NumberText(5.6251, 2), "5.63");
}

TEST(Table, AlignsColumns) {
  EXPECT_EQ(Table({{"a", "bb", "c"}, {"aaa", "b", "cc"}}), "a    bb  c\naaa  b   cc\n");
  EXPECT_EQ(Table({{"a", ""}, {"", "b"}}), "a\n   b\n");
}

TEST(PlanText, SaysWhatIsCaptured) {
  v1::Plan plan;
  plan.mutable_light_stage()->set_azimuths(32);
  EXPECT_EQ(PlanText(plan), "light stage: 32 azimuths over 180 deg, all lamps");
  plan.mutable_projector_4d()->set_tilts(7);
  plan.mutable_projector_4d()->mutable_azimuth_list()->add_angles_deg(45);
  plan.mutable_projector_4d()->set_grid(16);
  plan.mutable_projector_4d()->set_influence(2);
  plan.add_exposures_us(500);
  plan.set_dark_every(100);
  EXPECT_EQ(
      PlanText(plan),
      "projector 4D: 7 tilts x 1 azimuths (45 deg), grid 16, box, influence 2, exposures 500 us, "
      "dark frame every 100");
  for (int i = 0; i < 31; ++i)
    plan.mutable_projector_4d()->mutable_azimuth_list()->add_angles_deg(i);
  EXPECT_THAT(PlanText(plan), HasSubstr("32 azimuths (45 ... 30 deg)"));
}

TEST(EstimateText, NamesTheFieldsAsTheApiDoes) {
  v1::Plan plan;
  plan.mutable_light_stage()->set_azimuths(32);
  v1::EstimateRunResponse estimate;
  estimate.set_shots(1280);
  estimate.set_extra_shots(2);
  estimate.set_exposures(3846);
  estimate.set_positions(32);
  estimate.set_duration_seconds(3723);
  estimate.set_bytes(int64_t{2} << 30);
  estimate.set_free_bytes(int64_t{1} << 30);
  estimate.add_notes("the camera rounds 333 us to 332 us");
  EXPECT_EQ(EstimateText(plan, estimate),
            "light stage: 32 azimuths over 180 deg, all lamps\n"
            "shots            1280\n"
            "extraShots       2\n"
            "exposures        3846\n"
            "positions        32\n"
            "durationSeconds  1:02:03\n"
            "bytes            2.0 GiB (1.0 GiB free)\n"
            "note: the camera rounds 333 us to 332 us\n");
}

TEST(RunText, SaysWhyARunWaits) {
  v1::Run run;
  run.set_name("runs/a");
  run.set_display_name("a");
  run.set_state(v1::RUN_STATE_PAUSED);
  run.mutable_reason()->set_reason("DISK_FULL");
  run.mutable_reason()->set_message("12 B free");
  EXPECT_THAT(RunText(run), HasSubstr("DISK_FULL: 12 B free"));
  EXPECT_THAT(RunText(run), Not(HasSubstr("\nname")));  // the same as the id: said once
  EXPECT_THAT(RunText(run), Not(HasSubstr("ended")));
}

TEST(RigStateText, SaysThatNothingIsOn) {
  v1::RigState state;
  state.set_activity(v1::RIG_ACTIVITY_IDLE);
  EXPECT_EQ(RigStateText(state), "activity  idle\nlamps     dark\ncontrol   nobody\n");
}

TEST(Json, IsCanonicalOnOneLineWithEveryField) {
  v1::EstimateRunResponse estimate;
  estimate.set_shots(1280);
  estimate.set_bytes(int64_t{1} << 40);
  EXPECT_EQ(*ToJsonLine(estimate),
            "{\"shots\":1280,\"extraShots\":0,\"exposures\":0,\"positions\":0,"
            "\"durationSeconds\":0,\"bytes\":\"1099511627776\",\"freeBytes\":\"0\",\"notes\":[]}"
            "\n");
}

TEST(Json, AMessageWithoutJsonFormIsAnError) {
  v1::Run run;
  run.mutable_create_time()->set_seconds(int64_t{1} << 60);
  EXPECT_EQ(ErrorReason(ToJsonLine(run).status()), "JSON_FAILED");
}

TEST(Json, APlanIsReadStrictly) {
  auto plan = PlanFromJson(R"({"lightStage": {"azimuths": 4, "lamps": [1, 2]}, "darkEvery": 10})");
  ASSERT_TRUE(plan.ok()) << plan.status();
  EXPECT_EQ(plan->light_stage().azimuths(), 4);
  EXPECT_EQ(plan->dark_every(), 10);
  auto misspelt = PlanFromJson(R"({"lightStage": {"azimuth": 4}})");
  EXPECT_EQ(ErrorReason(misspelt.status()), "USAGE");
  EXPECT_THAT(MessageOf(misspelt.status()), HasSubstr("azimuth"));
  EXPECT_EQ(ErrorReason(PlanFromJson("{").status()), "USAGE");
}

}  // namespace
}  // namespace lightstage::client
