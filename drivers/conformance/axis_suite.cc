// The rules of drivers/api/axis.h.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "drivers/conformance/rule.h"

namespace lightstage {
namespace {

using std::chrono::milliseconds;

class AxisBench : public Bench<AxisFixture, Axis> {
 public:
  using Bench::Bench;

  const AxisInfo& info() { return device().info(); }

  // Deadlines leave room for the longest way at the asked velocity.
  Duration LongestMove(double velocity_dps = 0) {
    Angle low = info().continuous ? Degrees(0) : info().min;
    Angle high = info().continuous ? Degrees(180) : info().max;
    return MoveDuration(info(), low, high, velocity_dps) * 2 + patience();
  }
  std::shared_ptr<Outcome<AxisState>> Start(Angle target, double velocity_dps = 0) {
    auto done = Expect<AxisState>("Move");
    device().Move(target, velocity_dps, clock().Now() + LongestMove(velocity_dps), done->sink());
    return done;
  }
  absl::StatusOr<AxisState> Move(Angle target, double velocity_dps = 0) {
    return Start(target, velocity_dps)->Wait(LongestMove(velocity_dps) + patience());
  }
  absl::StatusOr<AxisState> Home() {
    auto done = Expect<AxisState>("Home");
    device().Home(clock().Now() + LongestMove(), done->sink());
    return done->Wait(LongestMove() + patience());
  }
  std::shared_ptr<Outcome<AxisState>> StartTurn(double velocity_dps) {
    auto done = Expect<AxisState>("Turn");
    device().Turn(velocity_dps, clock().Now() + std::chrono::minutes(1), done->sink());
    return done;
  }
  absl::StatusOr<AxisState> Stop() {
    auto done = Expect<AxisState>("Stop");
    device().Stop(Deadline(), done->sink());
    return done->Wait(patience());
  }
  AxisState Read() {
    auto done = Expect<AxisState>("Read");
    device().Read(Deadline(), done->sink());
    absl::StatusOr<AxisState> state = done->Wait(patience());
    EXPECT_TRUE(state.ok()) << state.status();
    return state.ok() ? *state : AxisState{};
  }
  bool Ready() {
    if (!open()) return false;
    absl::StatusOr<AxisState> homed = Home();
    EXPECT_TRUE(homed.ok()) << homed.status();
    return homed.ok();
  }

  // A point of the reachable range: share 0 is its start, 1 its end.
  Angle At(double share) {
    if (info().continuous) return Degrees(360 * share);
    return info().min + (info().max - info().min) * share;
  }
  // Far from where it is now, so that it takes a while.
  Angle FarAway() {
    AxisState now = Read();
    if (info().continuous) return now.position + Degrees(170);
    return (now.position - info().min) > (info().max - now.position) ? info().min : info().max;
  }
  void ExpectAt(const AxisState& state, Angle target) {
    Angle off = MoveDistance(info(), target, state.position);
    EXPECT_LE(std::abs(off.degrees()), info().tolerance.degrees() + 1e-9)
        << "at " << state.position.degrees() << " deg instead of " << target.degrees();
    EXPECT_FALSE(state.moving);
    EXPECT_TRUE(state.homed);
  }
};

void DescribesItself(AxisFixture& fixture) {
  AxisBench bench(fixture);
  if (!bench.open()) return;
  const AxisInfo& info = bench.info();
  EXPECT_FALSE(info.identity.name.empty());
  EXPECT_FALSE(info.identity.driver.empty());
  EXPECT_GT(info.max_velocity_dps, 0);
  EXPECT_GT(info.max_acceleration_dps2, 0);
  EXPECT_GE(info.settle, Duration::zero());
  EXPECT_GE(info.tolerance, Degrees(0));
  if (!info.continuous) {
    EXPECT_LT(info.min, info.max);
  }
}

void OpensAtRest(AxisFixture& fixture) {
  AxisBench bench(fixture);
  if (!bench.open()) return;
  EXPECT_FALSE(bench.Read().moving);
}

void MoveNeedsHoming(AxisFixture& fixture) {
  AxisBench bench(fixture);
  if (!bench.open()) return;
  AxisState before = bench.Read();
  if (before.homed) return;  // an absolute encoder
  absl::StatusOr<AxisState> moved = bench.Move(bench.At(0.5));
  ExpectError(moved.status(), absl::StatusCode::kFailedPrecondition, "NOT_HOMED", "unhomed Move");
  EXPECT_EQ(bench.Read().position, before.position);
  ASSERT_TRUE(bench.Ready());
  EXPECT_TRUE(bench.Read().homed);
  EXPECT_TRUE(bench.Move(bench.At(0.5)).ok());
}

void MoveArrivesSettled(AxisFixture& fixture) {
  AxisBench bench(fixture);
  if (!bench.Ready()) return;
  for (double share : {0.5, 0.25, 0.25, 0.0, 1.0, 0.9}) {
    Angle target = bench.At(share);
    absl::StatusOr<AxisState> moved = bench.Move(target);
    ASSERT_TRUE(moved.ok()) << moved.status();
    bench.ExpectAt(*moved, target);
    bench.ExpectAt(bench.Read(), target);
  }
}

void ContinuousAxisTakesAnyTurn(AxisFixture& fixture) {
  AxisBench bench(fixture);
  if (!bench.open() || !bench.info().continuous || !bench.Ready()) return;
  for (double degrees : {350.0, 10.0, -725.0, 3600.0 + 45.0}) {
    absl::StatusOr<AxisState> moved = bench.Move(Degrees(degrees));
    ASSERT_TRUE(moved.ok()) << moved.status();
    bench.ExpectAt(*moved, Degrees(degrees));
  }
}

void SlowMoveArrivesToo(AxisFixture& fixture) {
  AxisBench bench(fixture);
  if (!bench.Ready()) return;
  ASSERT_TRUE(bench.Move(bench.At(0.5)).ok());
  double slow = bench.info().max_velocity_dps / 4;
  Angle target = bench.At(0.5) + Degrees(std::min(1.0, slow / 10));
  absl::StatusOr<AxisState> moved = bench.Move(target, slow);
  ASSERT_TRUE(moved.ok()) << moved.status();
  bench.ExpectAt(*moved, target);
}

void OutOfRangeIsRefusedBeforeMotion(AxisFixture& fixture) {
  AxisBench bench(fixture);
  if (!bench.Ready()) return;
  ASSERT_TRUE(bench.Move(bench.At(0.5)).ok());
  AxisState before = bench.Read();
  constexpr double kInf = std::numeric_limits<double>::infinity();
  std::vector<Angle> bad = {Degrees(std::nan("")), Degrees(kInf), Degrees(-kInf)};
  if (!bench.info().continuous) {
    bad.insert(bad.end(),
               {bench.info().max + Degrees(0.5), bench.info().min - Degrees(0.5), Degrees(1e300)});
  }
  for (Angle target : bad) {
    std::string what = "target " + std::to_string(target.degrees());
    absl::StatusOr<AxisState> moved = bench.Move(target);
    ExpectError(moved.status(), absl::StatusCode::kOutOfRange, "AXIS_LIMIT", what);
    AxisState after = bench.Read();
    EXPECT_FALSE(after.moving) << what;
    EXPECT_EQ(after.position, before.position) << what << " must not move it";
  }
  EXPECT_TRUE(bench.Move(bench.At(0.25)).ok()) << "a refusal must leave the axis usable";
}

void SecondMotionIsRefused(AxisFixture& fixture) {
  AxisBench bench(fixture);
  if (!bench.Ready()) return;
  auto first = bench.Start(bench.FarAway());
  bool busy = !first->done();
  auto second = bench.Start(bench.At(0.5));
  busy = busy && !first->done();
  if (busy) {
    ExpectError(second->Wait(bench.patience()).status(), absl::StatusCode::kFailedPrecondition,
                "AXIS_BUSY", "second Move");
  }
  absl::StatusOr<AxisState> arrived = first->Wait(bench.LongestMove() + bench.patience());
  EXPECT_TRUE(arrived.ok()) << "a refused move must not disturb the one in progress: "
                            << arrived.status();
  second->Wait(bench.LongestMove() + bench.patience());
}

void StopCancelsTheMotion(AxisFixture& fixture) {
  AxisBench bench(fixture);
  if (!bench.Ready()) return;
  auto move = bench.Start(bench.FarAway());
  bool busy = !move->done();
  SleepFor(bench.clock(), milliseconds(20));
  busy = busy && !move->done();
  auto stop = bench.Expect<AxisState>("Stop");
  bench.device().Stop(bench.Deadline(), stop->sink());
  absl::StatusOr<AxisState> stopped = stop->Wait(bench.patience());
  ASSERT_TRUE(stopped.ok()) << stopped.status();
  EXPECT_FALSE(stopped->moving);
  EXPECT_EQ(stopped->velocity_dps, 0);
  absl::StatusOr<AxisState> moved = move->Wait(bench.patience());
  if (busy && !moved.ok()) {
    ExpectError(moved.status(), absl::StatusCode::kCancelled, "STOPPED", "stopped Move");
    EXPECT_LT(move->number(), stop->number()) << "the motion completes before its Stop";
  }
  AxisState rest = bench.Read();
  SleepFor(bench.clock(), milliseconds(20));
  EXPECT_EQ(bench.Read().position, rest.position) << "must stand still";
  EXPECT_TRUE(bench.Move(bench.At(0.5)).ok()) << "must move again after a Stop";
}

void TurnsUntilItIsStopped(AxisFixture& fixture) {
  AxisBench bench(fixture);
  if (!bench.open()) return;
  const AxisInfo& info = bench.info();
  if (!bench.Read().homed) {
    if (info.continuous) {
      absl::Status unhomed =
          bench.StartTurn(info.max_velocity_dps / 2)->Wait(bench.patience()).status();
      if (absl::IsUnimplemented(unhomed)) return;
      ExpectError(unhomed, absl::StatusCode::kFailedPrecondition, "NOT_HOMED", "unhomed Turn");
      EXPECT_FALSE(bench.Read().moving);
    }
    ASSERT_TRUE(bench.Ready());
  }
  for (double share : {0.5, -0.25}) {
    const double velocity = share * info.max_velocity_dps;
    const AxisState before = bench.Read();
    auto turn = bench.StartTurn(velocity);
    if (!info.continuous) {
      ExpectError(turn->Wait(bench.patience()).status(), absl::StatusCode::kFailedPrecondition,
                  "AXIS_LIMITED", "Turn of a limited axis");
      EXPECT_EQ(bench.Read().position, before.position);
      continue;
    }
    // Long enough to be at speed for a while, so that how long a command takes does not matter.
    const Duration at_speed = FromSeconds(std::abs(velocity) / info.max_acceleration_dps2);
    SleepFor(bench.clock(), at_speed + milliseconds(300));
    if (turn->done()) {
      ExpectError(turn->result().status(), absl::StatusCode::kUnimplemented, "CANNOT_TURN", "Turn");
      EXPECT_EQ(bench.Read().position, before.position);
      return;
    }
    const TimePoint first_asked = bench.clock().Now();
    const AxisState first = bench.Read();
    const TimePoint first_told = bench.clock().Now();
    EXPECT_TRUE(first.moving);
    SleepFor(bench.clock(), milliseconds(600));
    const TimePoint last_asked = bench.clock().Now();
    const AxisState last = bench.Read();
    const TimePoint last_told = bench.clock().Now();
    const double way = (last.position - first.position).degrees();
    // Both positions are of some time while they were asked for.
    const double least = std::abs(velocity) * Seconds(last_asked - first_told) * 0.8,
                 most = std::abs(velocity) * Seconds(last_told - first_asked) * 1.25;
    EXPECT_EQ(way > 0, velocity > 0) << way << " deg at " << velocity << " deg/s";
    EXPECT_GE(std::abs(way), least) << "at " << velocity << " deg/s";
    EXPECT_LE(std::abs(way), most) << "at " << velocity << " deg/s";
    EXPECT_FALSE(turn->done());
    absl::StatusOr<AxisState> stopped = bench.Stop();
    ASSERT_TRUE(stopped.ok()) << stopped.status();
    EXPECT_FALSE(stopped->moving);
    EXPECT_TRUE(stopped->homed);
    ASSERT_TRUE(turn->done());
    ExpectError(turn->result().status(), absl::StatusCode::kCancelled, "STOPPED", "stopped Turn");
    const AxisState rest = bench.Read();
    SleepFor(bench.clock(), milliseconds(50));
    EXPECT_EQ(bench.Read().position, rest.position) << "must stand still";
  }
  absl::StatusOr<AxisState> moved = bench.Move(bench.At(0.25));
  ASSERT_TRUE(moved.ok()) << moved.status();
  bench.ExpectAt(*moved, bench.At(0.25));
}

void TurnsEndInTheirTime(AxisFixture& fixture) {
  AxisBench bench(fixture);
  if (!bench.open() || !bench.info().continuous || !bench.Ready()) return;
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  for (double velocity : {0.0, kNan, bench.info().max_velocity_dps * 1.1}) {
    ExpectError(bench.StartTurn(velocity)->Wait(bench.patience()).status(),
                absl::StatusCode::kOutOfRange, "AXIS_VELOCITY", "Turn");
  }
  auto turn = bench.Expect<AxisState>("Turn");
  const TimePoint deadline = bench.clock().Now() + milliseconds(200);
  bench.device().Turn(bench.info().max_velocity_dps / 2, deadline, turn->sink());
  absl::StatusOr<AxisState> turned = turn->Wait(bench.patience());
  if (absl::IsUnimplemented(turned.status())) return;
  ExpectError(turned.status(), absl::StatusCode::kDeadlineExceeded, "", "late Turn");
  const TimePoint give_up = bench.clock().Now() + bench.patience();
  while (bench.Read().moving && bench.clock().Now() < give_up) {
    SleepFor(bench.clock(), milliseconds(10));
  }
  EXPECT_FALSE(bench.Read().moving) << "nobody waits for it any more";
}

void StopAtRestIsHarmless(AxisFixture& fixture) {
  AxisBench bench(fixture);
  if (!bench.Ready()) return;
  ASSERT_TRUE(bench.Move(bench.At(0.5)).ok());
  absl::StatusOr<AxisState> stopped = bench.Stop();
  ASSERT_TRUE(stopped.ok()) << stopped.status();
  bench.ExpectAt(*stopped, bench.At(0.5));
}

void DeadlineIsKept(AxisFixture& fixture) {
  AxisBench bench(fixture);
  if (!bench.Ready()) return;
  Angle target = bench.FarAway();
  TimePoint deadline = bench.clock().Now() + milliseconds(5);
  auto move = bench.Expect<AxisState>("Move");
  bench.device().Move(target, 0, deadline, move->sink());
  absl::StatusOr<AxisState> moved = move->Wait(bench.patience());
  if (!moved.ok()) {
    ExpectError(moved.status(), absl::StatusCode::kDeadlineExceeded, "", "late Move");
    EXPECT_GE(move->called_at(), deadline) << "gave up too early";
  }
  EXPECT_TRUE(bench.Stop().ok());
  EXPECT_TRUE(bench.Move(bench.At(0.5)).ok()) << "must be usable after a missed deadline";
}

void DestructorCompletesTheMotion(AxisFixture& fixture) {
  AxisBench bench(fixture);
  if (!bench.Ready()) return;
  auto move = bench.Start(bench.FarAway());
  bool busy = !move->done();
  bench.Close();  // checks that it was called, once
  if (busy && !move->result().ok()) {
    ExpectError(move->result().status(), absl::StatusCode::kCancelled, "", "Move");
  }
}

void MayBeMovedFromItsCompletion(AxisFixture& fixture) {
  AxisBench bench(fixture);
  if (!bench.Ready()) return;
  auto first = bench.Expect<AxisState>("first Move");
  auto second = bench.Expect<AxisState>("second Move");
  TimePoint deadline = bench.clock().Now() + bench.LongestMove() * 2;
  Angle there = bench.At(0.6);
  // Started from inside the first one's completion: no lock may be held there.
  bench.device().Move(bench.At(0.5), 0, deadline, first->sink([&] {
    bench.device().Move(there, 0, deadline, second->sink());
  }));
  absl::StatusOr<AxisState> moved = second->Wait(bench.LongestMove() * 2 + bench.patience());
  ASSERT_TRUE(moved.ok()) << moved.status();
  bench.ExpectAt(*moved, there);
  bench.Close();  // before what the completions refer to
}

constexpr Rule<AxisFixture> kRules[] = {
    {"DescribesItself", DescribesItself},
    {"OpensAtRest", OpensAtRest},
    {"MoveNeedsHoming", MoveNeedsHoming},
    {"MoveArrivesSettled", MoveArrivesSettled},
    {"ContinuousAxisTakesAnyTurn", ContinuousAxisTakesAnyTurn},
    {"SlowMoveArrivesToo", SlowMoveArrivesToo},
    {"OutOfRangeIsRefusedBeforeMotion", OutOfRangeIsRefusedBeforeMotion},
    {"SecondMotionIsRefused", SecondMotionIsRefused},
    {"StopCancelsTheMotion", StopCancelsTheMotion},
    {"TurnsUntilItIsStopped", TurnsUntilItIsStopped},
    {"TurnsEndInTheirTime", TurnsEndInTheirTime},
    {"StopAtRestIsHarmless", StopAtRestIsHarmless},
    {"DeadlineIsKept", DeadlineIsKept},
    {"DestructorCompletesTheMotion", DestructorCompletesTheMotion},
    {"MayBeMovedFromItsCompletion", MayBeMovedFromItsCompletion},
};

}  // namespace

bool RegisterAxisConformance(const std::string& name, FixtureFactory<AxisFixture> make) {
  return RegisterRules("AxisConformance/" + name, kRules, std::move(make), __FILE__, __LINE__);
}

}  // namespace lightstage
