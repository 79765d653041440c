#include "daemon/rpc/convert.h"

#include <cmath>
#include <limits>

#include "base/status.h"
#include "daemon/rpc/errors.h"
#include "daemon/rpc/names.h"
#include "gmock/gmock.h"
#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"
#include "gtest/gtest.h"

namespace lightstage::rpc {
namespace {

using testing::ElementsAre;

TEST(Plan, LightStageDefaults) {
  v1::Plan message;
  message.mutable_light_stage()->set_azimuths(4);
  auto plan = FromMessage(message, 3);
  ASSERT_TRUE(plan.ok()) << plan.status();
  const auto& stage = std::get<LightStagePlan>(plan->kind);
  EXPECT_THAT(stage.azimuths, ElementsAre(Degrees(0), Degrees(45), Degrees(90), Degrees(135)));
  EXPECT_THAT(stage.lamps, ElementsAre(0, 1, 2));
  EXPECT_EQ(stage.level, 1);
  EXPECT_TRUE(plan->common.exposures.empty());
}

TEST(Plan, ResolvedPlansComeBackFromTheirJson) {
  Plan stage;
  stage.common = {{std::chrono::microseconds(500), std::chrono::nanoseconds(4000500)}, 7, 9};
  stage.kind = LightStagePlan{{Degrees(5.625), Degrees(-3)}, {4, 2}, 0.25, Degrees(12)};
  Plan projector;
  projector.common.exposures = {std::chrono::milliseconds(2)};
  projector.kind = Projector4dPlan{{Degrees(10)},        {Degrees(20), Degrees(30)}, 32, 3,
                                   PatternProfile::kHat, AxisOrder::kAzimuthOutside};
  Plan full = projector;
  std::get<Projector4dPlan>(full.kind).influence.reset();
  for (const Plan& plan : {stage, projector, full}) {
    auto json = PlanToJson(plan);
    ASSERT_TRUE(json.ok());
    auto back = PlanFromJson(*json, 40);
    ASSERT_TRUE(back.ok()) << back.status();
    // The JSON is what is kept, so it is what must not change.
    EXPECT_EQ(*PlanToJson(*back), *json);
    EXPECT_EQ(back->common.exposures, plan.common.exposures);
  }
}

TEST(Plan, ErrorsNameTheField) {
  auto reason = [](const v1::Plan& plan) { return MessageOf(FromMessage(plan, 40).status()); };
  v1::Plan plan;
  EXPECT_THAT(reason(plan), testing::HasSubstr("program is not set"));
  plan.mutable_light_stage();
  EXPECT_THAT(reason(plan), testing::HasSubstr("azimuths is not set"));
  plan.mutable_light_stage()->set_azimuths(0);
  EXPECT_THAT(reason(plan), testing::HasSubstr("azimuths is 0"));
  plan.mutable_light_stage()->set_azimuths(1);
  plan.mutable_light_stage()->set_span_deg(std::nan(""));
  EXPECT_THAT(reason(plan), testing::HasSubstr("span_deg is nan"));
  plan.mutable_light_stage()->set_span_deg(0);
  EXPECT_THAT(reason(plan), testing::HasSubstr("span_deg is 0"));
  plan.mutable_light_stage()->clear_span_deg();
  for (double bad : {0.0, -1.0, std::nan(""), std::numeric_limits<double>::infinity(), 1e300}) {
    plan.clear_exposures_us();
    plan.add_exposures_us(bad);
    EXPECT_THAT(reason(plan), testing::HasSubstr("exposures_us is")) << bad;
  }
  v1::Plan projector;
  projector.mutable_projector_4d()->set_azimuths(1);
  projector.mutable_projector_4d()->set_tilts(1);
  projector.mutable_projector_4d()->set_grid(4);
  EXPECT_THAT(reason(projector), testing::HasSubstr("full is not set"));
  projector.mutable_projector_4d()->set_full(false);
  EXPECT_THAT(reason(projector), testing::HasSubstr("full is not set"));
}

TEST(Pattern, EveryArrangementComesBack) {
  Pattern horizontal{PatternArrangement::kHorizontal, PatternProfile::kGaussian, 16, 2, 1, 5};
  Pattern vertical{PatternArrangement::kVertical, PatternProfile::kHat, 16, 2, 5, 1};
  Pattern square{PatternArrangement::kSquare, PatternProfile::kBox, 16, 0, 15, 15};
  Pattern full{.arrangement = PatternArrangement::kFull};
  for (const Pattern& pattern : {horizontal, vertical, square, full, Pattern{}}) {
    auto back = FromMessage(ToMessage(pattern));
    ASSERT_TRUE(back.ok()) << back.status();
    EXPECT_EQ(*back, pattern);
  }
  EXPECT_FALSE(FromMessage(v1::Pattern{}).ok());
}

TEST(Errors, CarryExactlyOneErrorInfo) {
  grpc::Status status = ToGrpc(Error(absl::StatusCode::kOutOfRange, "AXIS_LIMIT", "tilt: 95 deg",
                                     {{"axis", "tilt"}, {"target_deg", "95"}}));
  EXPECT_EQ(status.error_code(), grpc::StatusCode::OUT_OF_RANGE);
  google::rpc::Status details;
  ASSERT_TRUE(details.ParseFromString(status.error_details()));
  ASSERT_EQ(details.details_size(), 1);
  google::rpc::ErrorInfo info;
  ASSERT_TRUE(details.details(0).UnpackTo(&info));
  EXPECT_EQ(info.reason(), "AXIS_LIMIT");
  EXPECT_EQ(info.domain(), "lightstaged");
  EXPECT_EQ(info.metadata().at("target_deg"), "95");
}

TEST(Names, Runs) {
  EXPECT_EQ(*RunId("runs/20040506-070809"), "20040506-070809");
  for (const char* bad : {"", "runs/", "runs/..", "runs/a/b", "shots/1", "runs/../../etc"})
    EXPECT_EQ(ErrorReason(RunId(bad).status()), "RESOURCE_NAME") << bad;
}

TEST(Names, PagesCoverAListWithoutGaps) {
  uint64_t seen = 0;
  std::string token;
  do {
    auto page = PageOf(2500, 1000, 100, 1000, token);
    ASSERT_TRUE(page.ok());
    EXPECT_EQ(page->first, seen);
    seen = page->last;
    token = page->next_token;
  } while (!token.empty());
  EXPECT_EQ(seen, 2500u);
  EXPECT_EQ(PageOf(5, 0, 100, 1000, "")->last, 5u);
  EXPECT_EQ(ErrorReason(PageOf(5, -1, 100, 1000, "").status()), "PAGE_SIZE");
  EXPECT_EQ(ErrorReason(PageOf(5, 1, 100, 1000, "x").status()), "PAGE_TOKEN");
  EXPECT_EQ(ErrorReason(PageOf(5, 1, 100, 1000, "6").status()), "PAGE_TOKEN");
}

}  // namespace
}  // namespace lightstage::rpc
