#include "client/cli/plan_flags.h"

#include "CLI/Config.hpp"
#include "CLI/Formatter.hpp"
#include "absl/strings/str_split.h"
#include "base/status.h"
#include "client/cli/messages.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace lightstage::client {
namespace {

// The plan that the words mean, as JSON of the fields that are set; or why not.
std::string Plan(const std::string& line) {
  CLI::App app;
  PlanFlags flags;
  AddPlanFlags(app, flags);
  std::vector<std::string> words = absl::StrSplit(line, ' ', absl::SkipEmpty());
  try {
    app.parse(std::vector<std::string>(words.rbegin(), words.rend()));
  } catch (const CLI::ParseError&) {
    return "unreadable";
  }
  auto plan = MakePlan(flags, PosixEnv());
  return plan.ok() ? plan->ShortDebugString() : ErrorReason(plan.status());
}

TEST(PlanFlags, DefaultsAreTheDissertations) {
  EXPECT_EQ(Plan("light-stage"), "light_stage { azimuths: 32 }");
  EXPECT_EQ(Plan("projector-4d"),
            "projector_4d { azimuths: 32 tilts: 7 grid: 16 profile: PATTERN_PROFILE_BOX full: true "
            "}");
  EXPECT_EQ(Plan("projector-4d --full"), Plan("projector-4d"));
}

TEST(PlanFlags, EveryFlagReachesThePlan) {
  EXPECT_EQ(
      Plan("light-stage --azimuths 4 --lamps 0,3,7-8 --exposures-us 500,4000 --dark-every 10 "
           "--reference-every 20 --span-deg 360 --level 0.5 --tilt-deg 0"),
      "exposures_us: 500 exposures_us: 4000 dark_every: 10 reference_every: 20 light_stage { "
      "azimuths: 4 span_deg: 360 lamps: 0 lamps: 3 lamps: 7 lamps: 8 level: 0.5 tilt_deg: 0 }");
  EXPECT_EQ(Plan("projector-4d --tilts 10,20 --azimuths 45. --grid 32 --influence 0 --pattern hat"),
            "projector_4d { azimuth_list { angles_deg: 45 } tilt_list { angles_deg: 10 angles_deg: "
            "20 } grid: 32 profile: PATTERN_PROFILE_HAT influence: 0 }");
}

// What the rig thinks of these is the daemon's to say.
TEST(PlanFlags, ValuesAreNotJudgedHere) {
  EXPECT_EQ(Plan("light-stage --azimuths 0 --dark-every -1"),
            "dark_every: -1 light_stage { azimuths: 0 }");
}

TEST(PlanFlags, BadFormIsRefused) {
  EXPECT_EQ(Plan("light-stage --exposures-us nan"), "unreadable");
  EXPECT_EQ(Plan("light-stage --azimuths many"), "unreadable");
  EXPECT_EQ(Plan("projector-4d --full --influence 2"), "unreadable");
  EXPECT_EQ(Plan("light-stage projector-4d"), "unreadable");
  EXPECT_EQ(Plan(""), "USAGE");
  EXPECT_EQ(Plan("--plan /nonexistent.json"), "USAGE");
  EXPECT_EQ(Plan("--plan /nonexistent.json light-stage"), "USAGE");
}

TEST(PlanFlags, AFileHoldsAnyPlan) {
  std::string path = ::testing::TempDir() + "/plan_flags_test.json";
  ASSERT_TRUE(PosixEnv()
                  .WriteFile(path, R"({"projector4d": {"azimuths": 1, "tilts": 1, "grid": 4,
                                       "influence": 1}})")
                  .ok());
  EXPECT_EQ(Plan("--plan " + path), "projector_4d { azimuths: 1 tilts: 1 grid: 4 influence: 1 }");
  ASSERT_TRUE(PosixEnv().Remove(path).ok());
}

}  // namespace
}  // namespace lightstage::client
