// The rules of drivers/api/lamps.h and drivers/api/projector.h.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "drivers/conformance/rule.h"

namespace lightstage {
namespace {

using std::chrono::milliseconds;

// ---- Lamps

class LampsBench : public Bench<LampsFixture, Lamps> {
 public:
  using Bench::Bench;

  const LampsInfo& info() { return device().info(); }
  std::vector<float> All(float level) { return std::vector<float>(info().count, level); }
  std::vector<float> One(int lamp, float level) {
    std::vector<float> levels = All(0);
    levels[lamp] = level;
    return levels;
  }
  std::shared_ptr<Outcome<LampsState>> Start(const std::vector<float>& levels) {
    auto done = Expect<LampsState>("Set");
    device().Set(levels, Deadline(), done->sink());
    return done;
  }
  absl::StatusOr<LampsState> Set(const std::vector<float>& levels) {
    return Start(levels)->Wait(patience());
  }
  std::shared_ptr<Outcome<LampsState>> StartDark() {
    auto done = Expect<LampsState>("Dark");
    device().Dark(Deadline(), done->sink());
    return done;
  }
  void ExpectEmitted(const std::vector<float>& levels, const char* when) {
    if (auto emitted = fixture().Emitted()) {
      EXPECT_EQ(*emitted, levels) << when;
    }
  }
};

bool IsDark(const std::vector<float>& levels) {
  return std::all_of(levels.begin(), levels.end(), [](float level) { return level == 0.0f; });
}

void LampsDescribeThemselves(LampsFixture& fixture) {
  LampsBench bench(fixture);
  if (!bench.open()) return;
  const LampsInfo& info = bench.info();
  EXPECT_FALSE(info.identity.name.empty());
  EXPECT_FALSE(info.identity.driver.empty());
  EXPECT_GT(info.count, 0);
  EXPECT_GE(info.steps, 0);
  EXPECT_GE(info.settle, Duration::zero());
  EXPECT_GE(info.max_time_to_dark, Duration::zero());
}

void OpenDarkAndCloseDark(LampsFixture& fixture) {
  LampsBench bench(fixture);
  if (!bench.open()) return;
  bench.ExpectEmitted(bench.All(0), "after Open");
  ASSERT_TRUE(bench.Set(bench.All(1)).ok());
  bench.Close();
  if (auto emitted = fixture.Emitted()) {
    EXPECT_TRUE(IsDark(*emitted)) << "after closing";
  }
}

void LevelsAreConfirmed(LampsFixture& fixture) {
  LampsBench bench(fixture);
  if (!bench.open()) return;
  const LampsInfo& info = bench.info();
  std::vector<float> ramp(info.count);
  for (int i = 0; i < info.count; ++i) ramp[i] = static_cast<float>(i + 1) / (info.count + 1);
  double step = info.steps > 0 ? 0.5 / info.steps : 0;
  for (const std::vector<float>& levels :
       {bench.One(0, 1), bench.One(info.count - 1, 1), ramp, bench.All(1), bench.All(0)}) {
    absl::StatusOr<LampsState> state = bench.Set(levels);
    ASSERT_TRUE(state.ok()) << state.status();
    ASSERT_EQ(state->levels.size(), levels.size());
    for (size_t i = 0; i < levels.size(); ++i) {
      EXPECT_NEAR(state->levels[i], levels[i], step + 1e-6) << "lamp " << i;
      if (levels[i] == 0 || levels[i] == 1) {
        EXPECT_EQ(state->levels[i], levels[i]) << "lamp " << i << ": dark and full are exact";
      }
      if (info.steps > 0) {
        double steps = state->levels[i] * info.steps;
        EXPECT_NEAR(steps, std::round(steps), 1e-3) << "lamp " << i << ": not one of its levels";
      }
    }
    bench.ExpectEmitted(state->levels, "what was confirmed is what is on");
  }
}

void WrongLevelsAreRefused(LampsFixture& fixture) {
  LampsBench bench(fixture);
  if (!bench.open()) return;
  absl::StatusOr<LampsState> before = bench.Set(bench.One(0, 1));
  ASSERT_TRUE(before.ok()) << before.status();
  std::vector<float> too_few(bench.info().count - 1, 0.0f);
  std::vector<float> too_many(bench.info().count + 1, 0.0f);
  float inf = std::numeric_limits<float>::infinity();
  for (const std::vector<float>& levels :
       {too_few, too_many, bench.One(0, -0.01f), bench.One(0, 1.01f), bench.One(0, inf),
        bench.One(bench.info().count - 1, std::numeric_limits<float>::quiet_NaN())}) {
    ExpectError(bench.Set(levels).status(), absl::StatusCode::kInvalidArgument, "LAMP_LEVEL",
                "wrong levels");
    bench.ExpectEmitted(before->levels, "a refusal changes nothing");
  }
}

void DarkIsConfirmed(LampsFixture& fixture) {
  LampsBench bench(fixture);
  if (!bench.open()) return;
  for (int repeat = 0; repeat < 2; ++repeat) {
    ASSERT_TRUE(bench.Set(bench.All(1)).ok());
    for (int twice = 0; twice < 2; ++twice) {  // dark when dark is fine
      absl::StatusOr<LampsState> state = bench.StartDark()->Wait(bench.patience());
      ASSERT_TRUE(state.ok()) << state.status();
      EXPECT_EQ(state->levels, bench.All(0));
      bench.ExpectEmitted(bench.All(0), "after Dark");
    }
  }
}

void DarkCancelsASetInProgress(LampsFixture& fixture) {
  LampsBench bench(fixture);
  if (!bench.open()) return;
  auto set = bench.Start(bench.All(1));
  bool busy = !set->done();
  auto dark = bench.StartDark();
  absl::StatusOr<LampsState> state = dark->Wait(bench.patience());
  ASSERT_TRUE(state.ok()) << state.status();
  EXPECT_TRUE(IsDark(state->levels));
  set->Wait(bench.patience());
  EXPECT_LT(set->number(), dark->number()) << "the Set completes before the Dark";
  if (busy && !set->result().ok()) {
    ExpectError(set->result().status(), absl::StatusCode::kCancelled, "", "Set");
  }
  bench.ExpectEmitted(bench.All(0), "after Dark");
}

void TimeToDarkIsLimited(LampsFixture& fixture) {
  LampsBench bench(fixture);
  if (!bench.open()) return;
  Duration longest = bench.info().max_time_to_dark;
  ExpectError(bench.device().SetTimeToDark(longest + milliseconds(1)),
              absl::StatusCode::kOutOfRange, "TIME_TO_DARK", "above the maximum");
  EXPECT_TRUE(bench.device().SetTimeToDark(longest).ok());
  EXPECT_TRUE(bench.device().SetTimeToDark(Duration::zero()).ok()) << "0 means never";
  EXPECT_TRUE(bench.device().Refresh().ok());
}

void GoDarkUnlessRefreshed(LampsFixture& fixture) {
  LampsBench bench(fixture);
  if (!bench.open() || bench.info().max_time_to_dark == Duration::zero()) return;
  if (!fixture.Emitted()) return;
  Duration time = std::min<Duration>(bench.info().max_time_to_dark, milliseconds(1500));
  ASSERT_TRUE(bench.device().SetTimeToDark(time).ok());
  ASSERT_TRUE(bench.Set(bench.All(1)).ok());
  for (int i = 0; i < 4; ++i) {  // 1.3 × time in all
    SleepFor(bench.clock(), time / 3);
    ASSERT_TRUE(bench.device().Refresh().ok());
    bench.ExpectEmitted(bench.All(1), "while refreshed");
  }
  TimePoint give_up = bench.clock().Now() + time + bench.patience();
  while (!IsDark(*fixture.Emitted()) && bench.clock().Now() < give_up) {
    SleepFor(bench.clock(), time / 10);
  }
  bench.ExpectEmitted(bench.All(0), "not refreshed any more");
  EXPECT_TRUE(bench.Set(bench.All(1)).ok()) << "must light again";
}

void LampsDestructorCompletesTheSet(LampsFixture& fixture) {
  LampsBench bench(fixture);
  if (!bench.open()) return;
  auto set = bench.Start(bench.All(1));
  bool busy = !set->done();
  bench.Close();  // checks that it was called, once
  if (busy && !set->result().ok()) {
    ExpectError(set->result().status(), absl::StatusCode::kCancelled, "", "Set");
  }
  if (auto emitted = fixture.Emitted()) {
    EXPECT_TRUE(IsDark(*emitted)) << "after closing";
  }
}

void MayBeSetFromTheirCompletion(LampsFixture& fixture) {
  LampsBench bench(fixture);
  if (!bench.open()) return;
  auto first = bench.Expect<LampsState>("first Set");
  auto second = bench.Expect<LampsState>("second Set");
  bench.device().Set(bench.All(1), bench.Deadline(), first->sink([&] {
    bench.device().Set(bench.One(0, 1), bench.Deadline(), second->sink());
  }));
  absl::StatusOr<LampsState> state = second->Wait(bench.patience());
  ASSERT_TRUE(state.ok()) << state.status();
  EXPECT_EQ(state->levels, bench.One(0, 1));
  bench.Close();  // before what the completions refer to
}

constexpr Rule<LampsFixture> kLampsRules[] = {
    {"DescribesItself", LampsDescribeThemselves},
    {"OpenDarkAndCloseDark", OpenDarkAndCloseDark},
    {"LevelsAreConfirmed", LevelsAreConfirmed},
    {"WrongLevelsAreRefused", WrongLevelsAreRefused},
    {"DarkIsConfirmed", DarkIsConfirmed},
    {"DarkCancelsASetInProgress", DarkCancelsASetInProgress},
    {"TimeToDarkIsLimited", TimeToDarkIsLimited},
    {"GoDarkUnlessRefreshed", GoDarkUnlessRefreshed},
    {"DestructorCompletesTheSet", LampsDestructorCompletesTheSet},
    {"MayBeSetFromItsCompletion", MayBeSetFromTheirCompletion},
};

// ---- Projector

class ProjectorBench : public Bench<ProjectorFixture, Projector> {
 public:
  using Bench::Bench;

  std::shared_ptr<Outcome<ProjectorState>> Start(const Pattern& pattern) {
    auto done = Expect<ProjectorState>("Show");
    device().Show(pattern, Deadline(), done->sink());
    return done;
  }
  std::shared_ptr<Outcome<ProjectorState>> StartBlack() {
    auto done = Expect<ProjectorState>("Black");
    device().Black(Deadline(), done->sink());
    return done;
  }
  void ExpectOnWall(const Pattern& pattern, const char* when) {
    if (auto wall = fixture().OnWall()) {
      EXPECT_EQ(*wall, pattern) << when;
    }
  }
};

Pattern Full() {
  Pattern pattern;
  pattern.arrangement = PatternArrangement::kFull;
  return pattern;
}

Pattern Square(PatternProfile profile, int grid, int column, int row) {
  Pattern pattern;
  pattern.arrangement = PatternArrangement::kSquare;
  pattern.profile = profile;
  pattern.grid = grid;
  pattern.column = column;
  pattern.row = row;
  return pattern;
}

bool IsBlack(const Pattern& pattern) { return pattern.arrangement == PatternArrangement::kBlack; }

void ProjectorDescribesItself(ProjectorFixture& fixture) {
  ProjectorBench bench(fixture);
  if (!bench.open()) return;
  const ProjectorInfo& info = bench.device().info();
  EXPECT_FALSE(info.identity.name.empty());
  EXPECT_FALSE(info.identity.driver.empty());
  EXPECT_GT(info.width, 0);
  EXPECT_GT(info.height, 0);
  EXPECT_GE(info.settle, Duration::zero());
}

void PatternsAreConfirmed(ProjectorFixture& fixture) {
  ProjectorBench bench(fixture);
  if (!bench.open()) return;
  if (auto wall = fixture.OnWall()) {
    EXPECT_TRUE(IsBlack(*wall)) << "after Open";
  }
  Pattern row = Square(PatternProfile::kGaussian, 16, 1, 5);
  row.arrangement = PatternArrangement::kHorizontal;
  row.influence = 2;
  for (const Pattern& pattern : {Full(), Square(PatternProfile::kBox, 16, 3, 11), row,
                                 Square(PatternProfile::kHat, 4, 3, 3), Pattern{}, Full()}) {
    absl::StatusOr<ProjectorState> state = bench.Start(pattern)->Wait(bench.patience());
    ASSERT_TRUE(state.ok()) << PatternName(pattern) << ": " << state.status();
    EXPECT_EQ(state->shown, pattern) << PatternName(pattern);
    bench.ExpectOnWall(pattern, "what was confirmed is what is shown");
  }
  bench.Close();
  if (auto wall = fixture.OnWall()) {
    EXPECT_TRUE(IsBlack(*wall)) << "after closing";
  }
}

void BlackCancelsAShowInProgress(ProjectorFixture& fixture) {
  ProjectorBench bench(fixture);
  if (!bench.open()) return;
  auto show = bench.Start(Full());
  bool busy = !show->done();
  auto black = bench.StartBlack();
  absl::StatusOr<ProjectorState> state = black->Wait(bench.patience());
  ASSERT_TRUE(state.ok()) << state.status();
  EXPECT_TRUE(IsBlack(state->shown));
  show->Wait(bench.patience());
  EXPECT_LT(show->number(), black->number()) << "the Show completes before the Black";
  if (busy && !show->result().ok()) {
    ExpectError(show->result().status(), absl::StatusCode::kCancelled, "", "Show");
  }
  if (auto wall = fixture.OnWall()) {
    EXPECT_TRUE(IsBlack(*wall)) << "after Black";
  }
}

void ProjectorDestructorCompletesTheShow(ProjectorFixture& fixture) {
  ProjectorBench bench(fixture);
  if (!bench.open()) return;
  auto show = bench.Start(Full());
  bool busy = !show->done();
  bench.Close();  // checks that it was called, once
  if (busy && !show->result().ok()) {
    ExpectError(show->result().status(), absl::StatusCode::kCancelled, "", "Show");
  }
  if (auto wall = fixture.OnWall()) {
    EXPECT_TRUE(IsBlack(*wall)) << "after closing";
  }
}

void MayShowFromItsCompletion(ProjectorFixture& fixture) {
  ProjectorBench bench(fixture);
  if (!bench.open()) return;
  auto first = bench.Expect<ProjectorState>("first Show");
  auto second = bench.Expect<ProjectorState>("second Show");
  Pattern square = Square(PatternProfile::kBox, 8, 1, 2);
  bench.device().Show(Full(), bench.Deadline(), first->sink([&] {
    bench.device().Show(square, bench.Deadline(), second->sink());
  }));
  absl::StatusOr<ProjectorState> state = second->Wait(bench.patience());
  ASSERT_TRUE(state.ok()) << state.status();
  EXPECT_EQ(state->shown, square);
  bench.Close();  // before what the completions refer to
}

constexpr Rule<ProjectorFixture> kProjectorRules[] = {
    {"DescribesItself", ProjectorDescribesItself},
    {"PatternsAreConfirmed", PatternsAreConfirmed},
    {"BlackCancelsAShowInProgress", BlackCancelsAShowInProgress},
    {"DestructorCompletesTheShow", ProjectorDestructorCompletesTheShow},
    {"MayShowFromItsCompletion", MayShowFromItsCompletion},
};

}  // namespace

bool RegisterLampsConformance(const std::string& name, FixtureFactory<LampsFixture> make) {
  return RegisterRules("LampsConformance/" + name, kLampsRules, std::move(make), __FILE__,
                       __LINE__);
}

bool RegisterProjectorConformance(const std::string& name, FixtureFactory<ProjectorFixture> make) {
  return RegisterRules("ProjectorConformance/" + name, kProjectorRules, std::move(make), __FILE__,
                       __LINE__);
}

}  // namespace lightstage
