#include "daemon/capture/program.h"

#include <gtest/gtest.h>

#include <set>
#include <tuple>

#include "daemon/capture/check_plan.h"
#include "daemon/capture/projector_4d.h"
#include "daemon/capture/test_rig.h"

namespace lightstage {
namespace {

using std::chrono::milliseconds;

std::vector<Shot> AllShots(const Plan& plan, const RigFacts& facts = TestRig()) {
  auto resolved = ResolvePlan(plan, facts);
  EXPECT_TRUE(resolved.ok()) << resolved.status();
  std::vector<Shot> shots;
  if (!resolved.ok()) return shots;
  std::unique_ptr<Program> program = MakeProgram(resolved->plan);
  NoResults none;
  for (;;) {
    auto step = program->Next(none);
    EXPECT_TRUE(step.ok()) << step.status();
    if (!step.ok() || !std::holds_alternative<Shot>(*step)) {
      EXPECT_TRUE(step.ok() && std::holds_alternative<Done>(*step));
      return shots;
    }
    shots.push_back(std::get<Shot>(*step));
  }
}

Plan LightStage(int azimuths, int lamps) {
  return {{}, LightStagePlan{EvenAzimuths(azimuths, Degrees(180)), AllLamps(lamps)}};
}

Plan Projector(int tilts, int azimuths, int grid, std::optional<int> influence) {
  return {{},
          Projector4dPlan{CellCentredTilts(tilts), EvenAzimuths(azimuths, Degrees(360)), grid,
                          influence}};
}

// A number that two programs share only if they are the same shot for shot.
auto Key(const Shot& shot) {
  return std::make_tuple(shot.id, shot.kind, shot.pose.azimuth, shot.pose.tilt,
                         shot.condition.lamps.empty() ? -1 : shot.condition.lamps[0].lamp,
                         shot.condition.pattern, shot.exposures);
}

void ExpectSame(const std::vector<Shot>& a, const std::vector<Shot>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (size_t i = 0; i < a.size(); ++i) ASSERT_EQ(Key(a[i]), Key(b[i])) << i;
}

TEST(PlanAngles, AreThoseOfTheMethod) {
  auto azimuths = EvenAzimuths(32, Degrees(180));
  EXPECT_EQ(azimuths[1].degrees(), 5.625);
  EXPECT_EQ(azimuths[31].degrees(), 174.375);
  auto tilts = CellCentredTilts(20);
  EXPECT_EQ(tilts.front().degrees(), 2.25);
  EXPECT_EQ(tilts.back().degrees(), 87.75);
  EXPECT_NEAR(CellCentredTilts(7)[3].degrees(), 45, 1e-12);
}

TEST(LightStage, TakesEveryLampAtEveryAzimuth) {
  std::vector<Shot> shots = AllShots(LightStage(32, 40));
  ASSERT_EQ(shots.size(), 1280u);
  EXPECT_EQ(shots[0].pose, (Pose{Degrees(0), Degrees(0)}));
  EXPECT_EQ(shots[0].condition.lamps, (std::vector<LampLevel>{{0, 1.0}}));
  EXPECT_EQ(shots[0].exposures, (std::vector<Duration>{milliseconds(1), milliseconds(8)}));
  EXPECT_EQ(shots[39].condition.lamps, (std::vector<LampLevel>{{39, 1.0}}));
  EXPECT_EQ(shots[40].pose.azimuth.degrees(), 5.625);
  EXPECT_EQ(shots[40].condition.lamps, (std::vector<LampLevel>{{0, 1.0}}));
  EXPECT_EQ(shots[1279].pose.azimuth.degrees(), 174.375);
  EXPECT_EQ(shots[1279].condition.lamps, (std::vector<LampLevel>{{39, 1.0}}));
  for (size_t i = 0; i < shots.size(); ++i) {
    ASSERT_EQ(shots[i].id, i);
    ASSERT_EQ(shots[i].kind, ShotKind::kBasis);
    ASSERT_FALSE(shots[i].condition.pattern);
  }
}

TEST(LightStage, KeepsTheOrderGiven) {
  Plan plan{{}, LightStagePlan{{Degrees(90), Degrees(0)}, {7, 3}, 0.5, Degrees(60)}};
  std::vector<Shot> shots = AllShots(plan);
  ASSERT_EQ(shots.size(), 4u);
  EXPECT_EQ(shots[0].pose, (Pose{Degrees(90), Degrees(60)}));
  EXPECT_EQ(shots[0].condition.lamps, (std::vector<LampLevel>{{7, 0.5}}));
  EXPECT_EQ(shots[1].condition.lamps, (std::vector<LampLevel>{{3, 0.5}}));
  EXPECT_EQ(shots[3].pose.azimuth.degrees(), 0);
}

TEST(LightStage, ParksTheGantryWhereItMayStand) {
  RigFacts facts = TestRig();
  facts.limits.tilt_min = Degrees(10);
  EXPECT_EQ(AllShots(LightStage(1, 1), facts)[0].pose.tilt.degrees(), 10);
  facts.tilt->min = Degrees(15);
  EXPECT_EQ(AllShots(LightStage(1, 1), facts)[0].pose.tilt.degrees(), 15);
  facts.tilt.reset();
  EXPECT_EQ(AllShots(LightStage(1, 1), facts)[0].pose.tilt.degrees(), 0);
}

TEST(Projector4d, CountsAreThoseOfTheMethod) {
  EXPECT_EQ(AllShots(Projector(7, 32, 16, {})).size(), 57344u);
  EXPECT_EQ(AllShots(Projector(7, 32, 16, 2)).size(), 21504u);
  EXPECT_EQ(AllShots(Projector(7, 8, 32, 3)).size(), 14336u);
}

TEST(Projector4d, FullGridGoesByRows) {
  std::vector<Shot> shots = AllShots(Projector(1, 1, 3, {}));
  ASSERT_EQ(shots.size(), 9u);
  EXPECT_EQ(shots[0].condition.pattern,
            (Pattern{PatternArrangement::kSquare, PatternProfile::kBox, 3, 0, 0, 0}));
  EXPECT_EQ(shots[1].condition.pattern,
            (Pattern{PatternArrangement::kSquare, PatternProfile::kBox, 3, 0, 1, 0}));
  EXPECT_EQ(shots[8].condition.pattern,
            (Pattern{PatternArrangement::kSquare, PatternProfile::kBox, 3, 0, 2, 2}));
  EXPECT_TRUE(shots[0].condition.lamps.empty());
}

TEST(Projector4d, SetLightsEverySquareOnceInEitherDirection) {
  constexpr int kGrid = 5, kInfluence = 1;
  std::vector<Shot> shots = AllShots(Projector(1, 1, kGrid, kInfluence));
  ASSERT_EQ(shots.size(), 20u);
  int horizontal[kGrid][kGrid] = {}, vertical[kGrid][kGrid] = {};
  for (const Shot& shot : shots) {
    ASSERT_TRUE(Validate(*shot.condition.pattern).ok());
    bool row_wise = shot.condition.pattern->arrangement == PatternArrangement::kHorizontal;
    EXPECT_EQ(row_wise, shot.id < 10);
    for (const GridSquare& square : LitSquares(*shot.condition.pattern)) {
      ++(row_wise ? horizontal : vertical)[square.row][square.column];
    }
  }
  for (int row = 0; row < kGrid; ++row) {
    for (int column = 0; column < kGrid; ++column) {
      EXPECT_EQ(horizontal[row][column], 1) << row << ' ' << column;
      EXPECT_EQ(vertical[row][column], 1) << row << ' ' << column;
    }
  }
}

struct AxisChanges {
  int azimuth = 0, tilt = 0, both = 0;
};

AxisChanges CountChanges(const std::vector<Shot>& shots) {
  AxisChanges changes;
  for (size_t i = 1; i < shots.size(); ++i) {
    bool azimuth = shots[i].pose.azimuth != shots[i - 1].pose.azimuth;
    bool tilt = shots[i].pose.tilt != shots[i - 1].pose.tilt;
    changes.azimuth += azimuth;
    changes.tilt += tilt;
    changes.both += azimuth && tilt;
  }
  return changes;
}

TEST(Projector4d, SlowAxisMovesLeast) {
  // The tilt is slower here, and its steps longer.
  AxisChanges changes = CountChanges(AllShots(Projector(7, 32, 1, {})));
  EXPECT_EQ(changes.tilt, 6);
  EXPECT_EQ(changes.azimuth, 7 * 31);
  EXPECT_EQ(changes.both, 0);

  RigFacts slow_table = TestRig();
  slow_table.turntable->max_velocity_dps = 5;
  changes = CountChanges(AllShots(Projector(7, 32, 1, {}), slow_table));
  EXPECT_EQ(changes.azimuth, 31);
  EXPECT_EQ(changes.tilt, 32 * 6);
  EXPECT_EQ(changes.both, 0);

  Plan given = Projector(7, 32, 1, {});
  std::get<Projector4dPlan>(given.kind).order = AxisOrder::kTiltOutside;
  EXPECT_EQ(CountChanges(AllShots(given, slow_table)).tilt, 6);
}

TEST(Projector4d, EveryPositionOnce) {
  for (AxisOrder order : {AxisOrder::kTiltOutside, AxisOrder::kAzimuthOutside}) {
    Plan plan = Projector(3, 4, 1, {});
    std::get<Projector4dPlan>(plan.kind).order = order;
    std::set<std::pair<Angle, Angle>> seen;
    for (const Shot& shot : AllShots(plan)) seen.insert({shot.pose.azimuth, shot.pose.tilt});
    EXPECT_EQ(seen.size(), 12u);
  }
}

std::string KindsOf(const std::vector<Shot>& shots) {
  std::string kinds;
  for (const Shot& shot : shots) kinds += "bdr"[static_cast<int>(shot.kind)];
  return kinds;
}

TEST(ExtraShots, StandBeforeAfterEveryNthAndAtTheEnd) {
  Plan plan = LightStage(2, 2);
  plan.common.dark_every = 3;
  EXPECT_EQ(KindsOf(AllShots(plan)), "dbbbdbd");
  plan.common.dark_every = 2;
  plan.common.reference_every = 4;
  std::vector<Shot> shots = AllShots(plan);
  EXPECT_EQ(KindsOf(shots), "drbbdbbdr");
  for (size_t i = 0; i < shots.size(); ++i) EXPECT_EQ(shots[i].id, i);
  // They move nothing: the first two stand at the first basis shot's pose, the others where the
  // shot before them stood.
  EXPECT_EQ(shots[1].pose, shots[2].pose);
  EXPECT_EQ(shots[4].pose, shots[3].pose);
  EXPECT_NE(shots[4].pose, shots[5].pose);
  EXPECT_EQ(shots[0].condition, Condition());
  EXPECT_EQ(shots[1].condition.lamps, (std::vector<LampLevel>{{0, 1.0}, {1, 1.0}}));

  Plan full = Projector(1, 1, 2, {});
  full.common.reference_every = 100;
  shots = AllShots(full);
  EXPECT_EQ(KindsOf(shots), "rbbbbr");
  EXPECT_EQ(shots[0].condition.pattern->arrangement, PatternArrangement::kFull);
}

TEST(Programs, AreTheSameEachTime) {
  Plan plan = Projector(3, 5, 4, 1);
  plan.common.dark_every = 7;
  ExpectSame(AllShots(plan), AllShots(plan));
}

// A resumed run takes its plan from the journal; the rig file's defaults and axes may have changed
// since.
TEST(Programs, FollowFromTheResolvedPlanAlone) {
  RigFacts then = TestRig(), now = TestRig();
  now.turntable->max_velocity_dps = 1;
  now.limits.tilt_min = Degrees(1);
  now.default_exposures = {milliseconds(3)};
  for (const Plan& plan : {Projector(3, 5, 2, {}), LightStage(2, 2)}) {
    auto resolved = ResolvePlan(plan, then);
    ASSERT_TRUE(resolved.ok());
    std::unique_ptr<Program> program = MakeProgram(resolved->plan);
    NoResults none;
    for (const Shot& shot : AllShots(plan, then)) {
      auto step = program->Next(none);
      ASSERT_EQ(Key(shot), Key(std::get<Shot>(*step)));
    }
  }
  Plan journalled = ResolvePlan(Projector(3, 5, 2, {}), then)->plan;
  ExpectSame(AllShots(journalled, now), AllShots(journalled, then));
}

}  // namespace
}  // namespace lightstage
