// Plans as a dry run: the dissertation's figures, and what is refused.
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "tests/harness/daemon.h"

namespace lightstage {
namespace {

TEST(Plan, CountsWhatTheDissertationCounts) {
  TestFolder folder;
  Daemon daemon(folder, SmallRig());
  struct Case {
    std::vector<std::string> plan;
    int shots, positions;
  };
  const std::vector<Case> cases = {
      {{"light-stage"}, 1280, 32},
      {{"light-stage", "--azimuths", "32", "--lamps", "all"}, 1280, 32},
      {{"light-stage", "--lamps", "0-19"}, 640, 32},
      {{"light-stage", "--azimuths", "64", "--span-deg", "360", "--lamps", "2,5-8"}, 320, 64},
      {{"projector-4d", "--full"}, 57344, 224},
      {{"projector-4d"}, 57344, 224},
      {{"projector-4d", "--influence", "2"}, 21504, 224},
      {{"projector-4d", "--tilts", "7", "--azimuths", "8", "--grid", "32", "--influence", "3"},
       14336,
       56},
      {{"projector-4d", "--influence", "2", "--pattern", "gaussian"}, 21504, 224},
      {{"projector-4d", "--influence", "2", "--pattern", "hat"}, 21504, 224},
  };
  for (const Case& c : cases) {
    std::vector<std::string> arguments = {"plan"};
    arguments.insert(arguments.end(), c.plan.begin(), c.plan.end());
    Answer answer = daemon.Ctl(arguments);
    ASSERT_EQ(answer.code, 0) << answer.err;
    ASSERT_EQ(answer.lines.size(), 1u);
    const Json& plan = answer.json();
    EXPECT_EQ(plan["shots"], c.shots) << plan;
    EXPECT_EQ(plan["positions"], c.positions) << plan;
    EXPECT_EQ(plan["exposures"], 2 * c.shots) << plan;  // the rig's bracket has two
    EXPECT_EQ(plan["extraShots"], 0) << plan;
    // The exposures alone take 17 ms per shot.
    EXPECT_GT(plan["durationSeconds"].get<double>(), 0.017 * c.shots);
    EXPECT_LT(plan["durationSeconds"].get<double>(), 0.1 * c.shots);
    EXPECT_GT(std::stoll(plan["bytes"].get<std::string>()), c.shots * 1000LL);
    EXPECT_GT(std::stoll(plan["freeBytes"].get<std::string>()), 0);
  }
  // Nothing was touched: the axes do not know their place yet, and no run is there.
  Json state = daemon.State();
  EXPECT_EQ(state["axes"][0]["homed"], false);
  EXPECT_TRUE(daemon.Ctl({"runs", "list"}).json()["runs"].empty());
}

TEST(Plan, DarkAndReferenceFramesAreExtra) {
  TestFolder folder;
  Daemon daemon(folder, SmallRig());
  auto extra = [&](const std::vector<std::string>& every) {
    std::vector<std::string> arguments = {"plan", "light-stage", "--azimuths",
                                          "4",    "--lamps",     "0-3"};
    arguments.insert(arguments.end(), every.begin(), every.end());
    Json plan = daemon.Ctl(arguments).json();
    EXPECT_EQ(plan["shots"], 16);
    return plan["extraShots"].get<int>();
  };
  // One before, one after every N, one at the end: 1 + ceil(16 / N).
  EXPECT_EQ(extra({"--dark-every", "4"}), 5);
  EXPECT_EQ(extra({"--dark-every", "5"}), 5);
  EXPECT_EQ(extra({"--reference-every", "8"}), 3);
  EXPECT_EQ(extra({"--reference-every", "100"}), 2);
  EXPECT_EQ(extra({"--dark-every", "4", "--reference-every", "8"}), 8);
}

TEST(Plan, SaysWhatTheCameraAdjusts) {
  TestFolder folder;
  Daemon daemon(folder, SmallRig());
  Json same = daemon.Ctl({"plan", "light-stage", "--exposures-us", "500,4000"}).json();
  EXPECT_TRUE(same["notes"].empty()) << same;
  // The simulated camera goes from 10 us to 10 s.
  Json shortest = daemon.Ctl({"plan", "light-stage", "--exposures-us", "3,4000"}).json();
  ASSERT_EQ(shortest["notes"].size(), 1u) << shortest;
  EXPECT_NE(shortest["notes"][0].get<std::string>().find("asked 3 us, real 10 us"),
            std::string::npos)
      << shortest["notes"];
  Json longest = daemon.Ctl({"plan", "light-stage", "--exposures-us", "500,20000000"}).json();
  ASSERT_EQ(longest["notes"].size(), 1u) << longest;
}

TEST(Plan, FileAndFlagsMeanTheSame) {
  TestFolder folder;
  Daemon daemon(folder, SmallRig());
  std::string file = folder / "plan.json";
  WriteText(file,
            R"({"exposuresUs": [500, 4000], "darkEvery": 8,
                "lightStage": {"azimuths": 8, "lamps": [0, 1, 2]}})");
  Json from_file = daemon.Ctl({"plan", "--plan", file}).json();
  Json from_flags = daemon
                        .Ctl({"plan", "light-stage", "--azimuths", "8", "--lamps", "0-2",
                              "--exposures-us", "500,4000", "--dark-every", "8"})
                        .json();
  for (const char* key :
       {"shots", "extraShots", "exposures", "positions", "durationSeconds", "bytes"})
    EXPECT_EQ(from_file[key], from_flags[key]) << key;
  EXPECT_EQ(from_file["shots"], 24);
}

struct Refused {
  const char* name;
  const char* plan;
  const char* reason;  // that the answer must name
};

// One daemon for all: a plan that is refused leaves nothing behind.
TEST(Plan, WhatIsBeyondLimitsIsRefusedWithAReason) {
  TestFolder folder;
  Daemon daemon(folder, SmallRig());
  const std::vector<Refused> cases = {
      {"no program", R"({})", "PLAN_FIELD"},
      {"no positions", R"({"lightStage": {}})", "PLAN_FIELD"},
      {"zero positions", R"({"lightStage": {"azimuths": 0}})", "PLAN_FIELD"},
      {"negative positions", R"({"lightStage": {"azimuths": -3}})", "PLAN_FIELD"},
      {"empty list", R"({"lightStage": {"azimuthList": {}}})", "AZIMUTHS_EMPTY"},
      {"empty list of tilts",
       R"({"projector4d": {"azimuths": 2, "tiltList": {"anglesDeg": []}, "grid": 8, "full": true}})",
       "TILTS_EMPTY"},
      {"NaN exposure", R"({"exposuresUs": ["NaN"], "lightStage": {"azimuths": 2}})", ""},
      {"infinite exposure", R"({"exposuresUs": ["Infinity"], "lightStage": {"azimuths": 2}})", ""},
      {"NaN azimuth", R"({"lightStage": {"azimuthList": {"anglesDeg": [0, "NaN"]}}})",
       "ANGLE_NOT_FINITE"},
      {"NaN span", R"({"lightStage": {"azimuths": 2, "spanDeg": "NaN"}})", "PLAN_FIELD"},
      {"NaN level", R"({"lightStage": {"azimuths": 2, "level": "NaN"}})", ""},
      {"NaN tilt", R"({"lightStage": {"azimuths": 2, "tiltDeg": "NaN"}})", "ANGLE_NOT_FINITE"},
      {"zero exposure", R"({"exposuresUs": [0], "lightStage": {"azimuths": 2}})", ""},
      {"negative exposure", R"({"exposuresUs": [-5], "lightStage": {"azimuths": 2}})", ""},
      {"huge exposure", R"({"exposuresUs": [1e300], "lightStage": {"azimuths": 2}})", ""},
      {"exposure beyond the limit", R"({"exposuresUs": [60000001], "lightStage": {"azimuths": 2}})",
       "EXPOSURE_LIMIT"},
      {"descending exposures", R"({"exposuresUs": [4000, 500], "lightStage": {"azimuths": 2}})",
       "EXPOSURES_NOT_ASCENDING"},
      {"exposures adjusted to one", R"({"exposuresUs": [1, 2], "lightStage": {"azimuths": 2}})",
       "EXPOSURES_NOT_ASCENDING"},
      {"too many exposures",
       R"({"exposuresUs": [1e3,2e3,3e3,4e3,5e3,6e3,7e3,8e3,9e3,10e3,11e3,12e3,13e3,14e3,15e3,16e3,17e3],
           "lightStage": {"azimuths": 2}})",
       "EXPOSURES_TOO_MANY"},
      {"unknown lamp", R"({"lightStage": {"azimuths": 2, "lamps": [0, 40]}})", "LAMP_UNKNOWN"},
      {"negative lamp", R"({"lightStage": {"azimuths": 2, "lamps": [-1]}})", "LAMP_UNKNOWN"},
      {"lamp twice", R"({"lightStage": {"azimuths": 2, "lamps": [3, 3]}})", "LAMP_DUPLICATE"},
      {"level above 1", R"({"lightStage": {"azimuths": 2, "level": 1.5}})", "LAMP_LEVEL"},
      {"negative level", R"({"lightStage": {"azimuths": 2, "level": -0.5}})", "LAMP_LEVEL"},
      {"azimuth beyond the limit", R"({"lightStage": {"azimuthList": {"anglesDeg": [361]}}})",
       "AZIMUTH_LIMIT"},
      {"azimuth twice", R"({"lightStage": {"azimuthList": {"anglesDeg": [0, 360]}}})",
       "AZIMUTH_DUPLICATE"},
      {"tilt beyond the limit",
       R"({"projector4d": {"azimuths": 2, "tiltList": {"anglesDeg": [91]}, "grid": 8, "full": true}})",
       "TILT_LIMIT"},
      {"span beyond a turn", R"({"lightStage": {"azimuths": 2, "spanDeg": 361}})", "PLAN_FIELD"},
      {"grid 0", R"({"projector4d": {"azimuths": 2, "tilts": 2, "grid": 0, "full": true}})", ""},
      {"grid too fine",
       R"({"projector4d": {"azimuths": 2, "tilts": 2, "grid": 300, "full": true}})",
       "GRID_TOO_FINE"},
      {"influence as large as the grid",
       R"({"projector4d": {"azimuths": 2, "tilts": 2, "grid": 8, "influence": 8}})", ""},
      {"negative influence",
       R"({"projector4d": {"azimuths": 2, "tilts": 2, "grid": 8, "influence": -1}})", ""},
      {"no set", R"({"projector4d": {"azimuths": 2, "tilts": 2, "grid": 8}})", "PLAN_FIELD"},
      {"full but not", R"({"projector4d": {"azimuths": 2, "tilts": 2, "grid": 8, "full": false}})",
       "PLAN_FIELD"},
      {"negative interval", R"({"darkEvery": -1, "lightStage": {"azimuths": 2}})", ""},
      {"too large",
       R"({"projector4d": {"azimuths": 1000, "tilts": 90, "grid": 192, "full": true}})",
       "PLAN_TOO_LARGE"},
  };
  std::string file = folder / "plan.json";
  for (const Refused& c : cases) {
    SCOPED_TRACE(c.name);
    WriteText(file, c.plan);
    for (const char* command : {"plan", "capture"}) {
      Answer answer = daemon.Ctl({command, "--plan", file});
      EXPECT_EQ(answer.code, 1) << command << ": " << answer.err;
      EXPECT_EQ(answer.out, "") << command;
      EXPECT_NE(answer.err.find(c.reason), std::string::npos) << command << ": " << answer.err;
      EXPECT_GT(answer.err.size(), 40u) << "says too little: " << answer.err;
    }
  }
  EXPECT_TRUE(daemon.Ctl({"runs", "list"}).json()["runs"].empty());
  EXPECT_EQ(daemon.State()["activity"], "RIG_ACTIVITY_IDLE");
}

TEST(Plan, WhatCannotBeReadIsTheCommandLinesFault) {
  TestFolder folder;
  Daemon daemon(folder, SmallRig());
  std::string file = folder / "plan.json";
  WriteText(file, R"({"lightStage": {"azimuths": 2}, "lampes": 3})");
  Answer unknown = daemon.Ctl({"plan", "--plan", file});
  EXPECT_EQ(unknown.code, 2);
  EXPECT_NE(unknown.err.find("lampes"), std::string::npos) << unknown.err;
  WriteText(file, "{");
  EXPECT_EQ(daemon.Ctl({"capture", "--plan", file}).code, 2);
  EXPECT_EQ(daemon.Ctl({"plan", "--plan", folder / "missing.json"}).code, 2);
  EXPECT_EQ(daemon.Ctl({"plan"}).code, 2);
  EXPECT_EQ(daemon.Ctl({"plan", "light-stage", "--exposures-us", "fast"}).code, 2);
  EXPECT_EQ(daemon.Ctl({"plan", "light-stage", "--lamps", "all-of-them"}).code, 2);
  EXPECT_EQ(daemon.Ctl({"plan", "projector-4d", "--full", "--influence", "2"}).code, 2);
  EXPECT_EQ(daemon.Ctl({"frobnicate"}).code, 2);
}

}  // namespace
}  // namespace lightstage
