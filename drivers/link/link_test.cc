// The contracts that drivers/link keeps, over links to devices that are only thought.
#include <gtest/gtest.h>
#include <spdlog/sinks/ringbuffer_sink.h>
#include <spdlog/spdlog.h>

#include <atomic>
#include <cmath>
#include <thread>

#include "absl/functional/function_ref.h"
#include "drivers/conformance/fixtures.h"
#include "drivers/link/axis_link.h"
#include "drivers/link/device_thread.h"
#include "drivers/link/light_link.h"

namespace lightstage {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

absl::Status Fault(absl::StatusCode code, const char* reason) {
  return Error(code, reason, "as the test says");
}

// A drive of constant velocity that stands at once; what it is told and what happens to it.
struct Drive {
  explicit Drive(bool turns) : continuous(turns) {}
  const bool continuous;
  RealClock clock;
  Mutex mutex;
  double from = 12, to = 12;  // degrees
  double dps = 0;
  TimePoint start{};
  bool homed = false, connected = false, homing = false;
  int connects = 0, halts = 0;
  bool deaf = false;       // takes commands and does nothing
  double slips = 0;        // degrees by which it misses
  absl::Status next_read;  // what the next Read fails with
  absl::Status halt;       // what Halt fails with, and does nothing

  double At(TimePoint now) const {
    const double way = dps * Seconds(now - start);
    return std::abs(to - from) <= way ? to : from + std::copysign(way, to - from);
  }
  void Go(double target, double velocity) {
    const TimePoint now = clock.Now();
    from = At(now);
    to = target;
    dps = velocity;
    start = now;
  }
};

class DriveLink final : public AxisLink {
 public:
  explicit DriveLink(Drive& drive) : drive_(drive) {}
  ~DriveLink() override { drive_.connected = false; }
  absl::Status Connect() override {
    MutexLock lock(&drive_.mutex);
    drive_.connected = true;
    drive_.homed = drive_.homing = false;
    drive_.from = drive_.to = drive_.At(drive_.clock.Now());
    ++drive_.connects;
    return absl::OkStatus();
  }
  AxisInfo info() const override {
    AxisInfo info;
    info.identity.model = "thought";
    info.min = Degrees(0);
    info.max = Degrees(90);
    info.continuous = drive_.continuous;
    info.max_velocity_dps = 2000;
    info.max_acceleration_dps2 = 1e5;
    info.settle = milliseconds(10);
    info.tolerance = Degrees(0.01);
    return info;
  }
  absl::StatusOr<AxisReading> Read() override {
    MutexLock lock(&drive_.mutex);
    if (!drive_.next_read.ok()) return std::exchange(drive_.next_read, absl::OkStatus());
    if (!drive_.connected) return Fault(absl::StatusCode::kUnavailable, "DEVICE_LOST");
    const double at = drive_.At(drive_.clock.Now());
    const bool moving = at != drive_.to;
    if (drive_.homing && !moving) {
      drive_.homing = false;
      drive_.homed = true;
    }
    return AxisReading{Degrees(at), moving ? drive_.dps : 0, moving, drive_.homed};
  }
  absl::Status StartHome() override {
    MutexLock lock(&drive_.mutex);
    drive_.homed = false;
    if (drive_.deaf) return absl::OkStatus();
    drive_.homing = true;
    drive_.Go(0, 2000);
    return absl::OkStatus();
  }
  absl::Status StartMove(Angle target, double velocity_dps) override {
    MutexLock lock(&drive_.mutex);
    if (!drive_.deaf) drive_.Go(target.degrees() + drive_.slips, velocity_dps);
    return absl::OkStatus();
  }
  absl::Status StartTurn(double velocity_dps, Duration) override {
    MutexLock lock(&drive_.mutex);
    if (drive_.deaf) return absl::OkStatus();
    drive_.Go(std::copysign(1e9, velocity_dps), std::abs(velocity_dps));
    return absl::OkStatus();
  }
  absl::Status Halt() override {
    MutexLock lock(&drive_.mutex);
    ++drive_.halts;
    if (!drive_.halt.ok()) return drive_.halt;
    drive_.homing = false;
    drive_.from = drive_.to = drive_.At(drive_.clock.Now());
    return absl::OkStatus();
  }

 private:
  Drive& drive_;
};

struct AxisOverDrive : AxisFixture {
  explicit AxisOverDrive(bool turns) : drive(turns) {}
  Clock& clock() override { return drive.clock; }
  absl::StatusOr<std::unique_ptr<Axis>> Open() override {
    return OpenLinkedAxis({"turntable", &drive.clock, nullptr}, "thought",
                          std::make_unique<DriveLink>(drive), milliseconds(2));
  }
  Drive drive;
};

const bool kAxes =
    RegisterAxisConformance("Linked", [] { return std::make_unique<AxisOverDrive>(false); }) &&
    RegisterAxisConformance("LinkedTurning", [] { return std::make_unique<AxisOverDrive>(true); });

class LinkedAxisTest : public testing::Test {
 protected:
  explicit LinkedAxisTest(bool turns = false) : over_(turns), axis_(*over_.Open()) {}
  absl::Status Home() {
    Pending<AxisState> done(over_.clock());
    axis_->Home(In(seconds(20)), done.sink());
    return done.Wait(kNever, "Home").status();
  }
  absl::Status Move(double degrees, Duration time = seconds(20)) {
    Pending<AxisState> done(over_.clock());
    axis_->Move(Degrees(degrees), 0, In(time), done.sink());
    return done.Wait(kNever, "Move").status();
  }
  TimePoint In(Duration time) { return over_.clock().Now() + time; }
  void FailNextRead(absl::Status status) {
    MutexLock lock(&over_.drive.mutex);
    over_.drive.next_read = std::move(status);
  }

  AxisOverDrive over_;
  std::unique_ptr<Axis> axis_;
};

TEST_F(LinkedAxisTest, ADriveThatDoesNotMoveIsNoticed) {
  ASSERT_TRUE(Home().ok());
  over_.drive.deaf = true;
  const absl::Status moved = Move(45);
  EXPECT_EQ(ErrorReason(moved), "AXIS_OFF_TARGET") << moved;
  EXPECT_EQ(ErrorReason(Home()), "AXIS_OFF_TARGET");
}

TEST_F(LinkedAxisTest, ADriveThatStopsElsewhereIsNoticed) {
  ASSERT_TRUE(Home().ok());
  over_.drive.slips = 0.02;
  const absl::Status moved = Move(45);
  EXPECT_EQ(ErrorReason(moved), "AXIS_OFF_TARGET") << moved;
  EXPECT_NE(moved.message().find("45.02"), std::string::npos) << moved;
  // What it counts is not believed any more.
  over_.drive.slips = 0.005;
  EXPECT_EQ(ErrorReason(Move(30)), "NOT_HOMED");
  EXPECT_TRUE(Home().ok());
  EXPECT_TRUE(Move(30).ok());
}

// As after a power cut of a drive that keeps the bit for homed, but not its count.
TEST_F(LinkedAxisTest, ADriveThatStandsWhereNobodyMovedItHasToBeHomed) {
  ASSERT_TRUE(Home().ok());
  ASSERT_TRUE(Move(45).ok());
  const auto homed = [&] {
    Pending<AxisState> done(over_.clock());
    axis_->Read(In(seconds(20)), done.sink());
    return done.Wait(kNever, "Read")->homed;
  };
  EXPECT_TRUE(homed());
  {
    MutexLock lock(&over_.drive.mutex);
    over_.drive.from = over_.drive.to = 45.7;
  }
  EXPECT_FALSE(homed());
  EXPECT_EQ(ErrorReason(Move(45)), "NOT_HOMED");
  EXPECT_TRUE(Home().ok());
  EXPECT_TRUE(homed());
  EXPECT_TRUE(Move(45).ok());
}

class LinkedTurnTest : public LinkedAxisTest {
 protected:
  LinkedTurnTest() : LinkedAxisTest(true) {}
  Pending<AxisState> Turn(double dps) {
    Pending<AxisState> done(over_.clock());
    axis_->Turn(dps, In(seconds(20)), done.sink());
    return done;
  }
  bool Homed() {
    Pending<AxisState> done(over_.clock());
    axis_->Read(In(seconds(20)), done.sink());
    return done.Wait(kNever, "Read")->homed;
  }
  bool Turns() {
    MutexLock lock(&over_.drive.mutex);
    return over_.drive.At(over_.clock().Now()) != over_.drive.to;
  }
  int Halts() {
    MutexLock lock(&over_.drive.mutex);
    return over_.drive.halts;
  }
  bool Becomes(absl::FunctionRef<bool()> ready) {
    for (const TimePoint give_up = In(seconds(20)); !ready();) {
      if (over_.clock().Now() > give_up) return false;
      SleepFor(over_.clock(), milliseconds(1));
    }
    return true;
  }
};

TEST_F(LinkedTurnTest, ADriveThatDoesNotTurnIsNoticed) {
  ASSERT_TRUE(Home().ok());
  over_.drive.deaf = true;
  const absl::Status turned = Turn(-50).Wait(kNever, "Turn").status();
  EXPECT_EQ(ErrorReason(turned), "AXIS_STALLED") << turned;
  EXPECT_NE(turned.message().find("-50 deg/s"), std::string::npos) << turned;
}

TEST_F(LinkedTurnTest, AnErrorOnTheWayHaltsAndTakesTheReference) {
  ASSERT_TRUE(Home().ok());
  ASSERT_TRUE(Homed());
  auto turn = Turn(50);
  SleepFor(over_.clock(), milliseconds(20));
  FailNextRead(Fault(absl::StatusCode::kDeadlineExceeded, "DEVICE_SILENT"));
  EXPECT_EQ(ErrorReason(turn.Wait(kNever, "Turn").status()), "DEVICE_SILENT");
  EXPECT_FALSE(Homed());
  EXPECT_EQ(Halts(), 1);
  MutexLock lock(&over_.drive.mutex);
  EXPECT_LT(over_.drive.to, 20) << "it must not go on";
}

// Nothing may turn on because a wire was cut for a while.
TEST_F(LinkedTurnTest, AHaltThatIsNotConfirmedIsCommandedAgain) {
  for (bool lost : {false, true}) {
    ASSERT_TRUE(Home().ok());
    const int connects = over_.drive.connects, halts = Halts();
    auto turn = Turn(50);
    SleepFor(over_.clock(), milliseconds(20));
    {
      MutexLock lock(&over_.drive.mutex);
      over_.drive.next_read = over_.drive.halt =
          lost ? Fault(absl::StatusCode::kUnavailable, "DEVICE_LOST")
               : Fault(absl::StatusCode::kDeadlineExceeded, "DEVICE_SILENT");
    }
    EXPECT_FALSE(turn.Wait(kNever, "Turn").ok());
    EXPECT_TRUE(Becomes([&] { return Halts() > halts; }));
    EXPECT_TRUE(Turns()) << "it did not hear";
    {
      MutexLock lock(&over_.drive.mutex);
      over_.drive.halt = absl::OkStatus();
    }
    EXPECT_TRUE(Becomes([&] { return !Turns(); }));
    MutexLock lock(&over_.drive.mutex);
    EXPECT_EQ(over_.drive.connects, lost ? connects + 1 : connects);
  }
}

TEST_F(LinkedTurnTest, AStopOnALostLinkConnectsAnew) {
  {
    MutexLock lock(&over_.drive.mutex);
    over_.drive.halt = Fault(absl::StatusCode::kUnavailable, "DEVICE_LOST");
  }
  Pending<AxisState> stopped(over_.clock());
  axis_->Stop(In(seconds(20)), stopped.sink());
  EXPECT_TRUE(stopped.Wait(kNever, "Stop").ok());
  EXPECT_EQ(over_.drive.connects, 2);
}

TEST_F(LinkedAxisTest, AMoveThatIsTooLateIsHalted) {
  ASSERT_TRUE(Home().ok());
  EXPECT_EQ(ErrorReason(Move(90, milliseconds(5))), "DEVICE_SILENT");
  EXPECT_TRUE(over_.clock().WaitUntil(In(seconds(20)), [&] {
    SleepFor(over_.clock(), milliseconds(1));
    MutexLock lock(&over_.drive.mutex);
    return over_.drive.halts > 0;
  }));
  EXPECT_LT(over_.drive.to, 80);
}

TEST_F(LinkedAxisTest, AnErrorOnTheWayHaltsAndIsTold) {
  ASSERT_TRUE(Home().ok());
  Pending<AxisState> done(over_.clock());
  axis_->Move(Degrees(90), 100, In(seconds(20)), done.sink());
  SleepFor(over_.clock(), milliseconds(20));
  FailNextRead(Fault(absl::StatusCode::kDeadlineExceeded, "DEVICE_SILENT"));
  EXPECT_EQ(ErrorReason(done.Wait(kNever, "Move").status()), "DEVICE_SILENT");
  EXPECT_EQ(ErrorReason(Move(10)), "NOT_HOMED");
  EXPECT_GT(over_.drive.halts, 0);
  EXPECT_TRUE(Home().ok());
  EXPECT_TRUE(Move(10).ok());
}

TEST_F(LinkedAxisTest, AFaultIsClearedByHomingOnly) {
  ASSERT_TRUE(Home().ok());
  FailNextRead(Fault(absl::StatusCode::kFailedPrecondition, "DEVICE_FAULT"));
  EXPECT_EQ(ErrorReason(Move(20)), "DEVICE_FAULT");
  FailNextRead(Fault(absl::StatusCode::kFailedPrecondition, "DEVICE_FAULT"));
  EXPECT_TRUE(Home().ok());
  EXPECT_TRUE(Move(20).ok());
}

// A node that is there again may be found to have been away only once it is asked.
TEST_F(LinkedAxisTest, ALossThatShowsInHomingIsMendedByIt) {
  ASSERT_TRUE(Home().ok());
  ASSERT_TRUE(Move(60).ok());
  const int connects = over_.drive.connects;
  FailNextRead(Fault(absl::StatusCode::kUnavailable, "DEVICE_LOST"));
  EXPECT_TRUE(Home().ok());
  EXPECT_EQ(over_.drive.connects, connects + 1);
  EXPECT_TRUE(Move(60).ok());
  Pending<AxisState> homing(over_.clock());
  axis_->Home(In(seconds(20)), homing.sink());
  SleepFor(over_.clock(), milliseconds(10));
  FailNextRead(Fault(absl::StatusCode::kUnavailable, "DEVICE_LOST"));
  EXPECT_TRUE(homing.Wait(kNever, "Home").ok());
  EXPECT_EQ(over_.drive.connects, connects + 2);
}

TEST_F(LinkedAxisTest, ALostLinkComesBackByHomingOnly) {
  ASSERT_TRUE(Home().ok());
  {
    MutexLock lock(&over_.drive.mutex);
    over_.drive.connected = false;
  }
  EXPECT_EQ(ErrorReason(Move(20)), "DEVICE_LOST");
  EXPECT_EQ(ErrorReason(Move(20)), "DEVICE_LOST");
  EXPECT_EQ(over_.drive.connects, 1);
  EXPECT_TRUE(Home().ok());
  EXPECT_EQ(over_.drive.connects, 2);
  EXPECT_TRUE(Move(20).ok());
}

TEST(LinkedDevices, WantRealTime) {
  VirtualClock clock;
  Drive drive(false);
  auto axis = OpenLinkedAxis({"tilt", &clock, nullptr}, "thought",
                             std::make_unique<DriveLink>(drive), milliseconds(2));
  EXPECT_EQ(ErrorReason(axis.status()), "DEVICE_UNSUITABLE");
}

// Lamps in eight bits that take a while, with a dark-man timer.
struct Lights {
  RealClock clock;
  Mutex mutex;
  std::vector<float> on = std::vector<float>(5, 0.0f);
  Duration time_to_dark{};
  TimePoint dark_at = kNever;
  int connects = 0;
  absl::Status next;  // what the next Set fails with
  absl::Status check;

  void RestartLocked() {
    dark_at = time_to_dark == Duration::zero() ? kNever : clock.Now() + time_to_dark;
  }
};

class LightsLink final : public LampsLink {
 public:
  explicit LightsLink(Lights& lights) : lights_(lights) {}
  absl::Status Connect() override {
    MutexLock lock(&lights_.mutex);
    ++lights_.connects;
    lights_.on.assign(lights_.on.size(), 0.0f);
    return absl::OkStatus();
  }
  LampsInfo info() const override {
    LampsInfo info;
    info.identity.model = "thought";
    info.count = static_cast<int>(lights_.on.size());
    info.steps = 255;
    info.settle = milliseconds(3);
    info.max_time_to_dark = seconds(2);
    return info;
  }
  absl::StatusOr<std::vector<float>> Set(const std::vector<float>& levels) override {
    SleepFor(lights_.clock, milliseconds(2));
    MutexLock lock(&lights_.mutex);
    if (!lights_.next.ok()) return std::exchange(lights_.next, absl::OkStatus());
    for (size_t i = 0; i < levels.size(); ++i) lights_.on[i] = std::round(levels[i] * 255) / 255;
    lights_.RestartLocked();
    return lights_.on;
  }
  absl::Status Check() override {
    MutexLock lock(&lights_.mutex);
    return lights_.check;
  }
  absl::Status SetTimeToDark(Duration time) override {
    MutexLock lock(&lights_.mutex);
    lights_.time_to_dark = time;
    lights_.RestartLocked();
    return absl::OkStatus();
  }
  absl::Status Refresh() override {
    MutexLock lock(&lights_.mutex);
    lights_.RestartLocked();
    return absl::OkStatus();
  }

 private:
  Lights& lights_;
};

struct LampsOverLights : LampsFixture {
  Clock& clock() override { return lights.clock; }
  absl::StatusOr<std::unique_ptr<Lamps>> Open() override {
    return OpenLinkedLamps({"lamps", &lights.clock, nullptr}, "thought",
                           std::make_unique<LightsLink>(lights));
  }
  std::optional<std::vector<float>> Emitted() override {
    MutexLock lock(&lights.mutex);
    if (lights.clock.Now() < lights.dark_at) return lights.on;
    return std::vector<float>(lights.on.size(), 0.0f);
  }
  Lights lights;
};

const bool kLamps =
    RegisterLampsConformance("Linked", [] { return std::make_unique<LampsOverLights>(); });

TEST(LinkedLamps, ComeBackAfterALoss) {
  LampsOverLights over;
  auto lamps = *over.Open();
  const std::vector<float> levels(5, 1.0f);
  auto set = [&] {
    Pending<LampsState> done(over.clock());
    lamps->Set(levels, over.clock().Now() + seconds(20), done.sink());
    return done.Wait(kNever, "Set").status();
  };
  ASSERT_TRUE(set().ok());
  over.lights.next = Fault(absl::StatusCode::kUnavailable, "DEVICE_LOST");
  EXPECT_EQ(ErrorReason(set()), "DEVICE_LOST");
  EXPECT_EQ(over.lights.connects, 1);
  EXPECT_TRUE(set().ok());
  EXPECT_EQ(over.lights.connects, 2);
  over.lights.next = Fault(absl::StatusCode::kDeadlineExceeded, "DEVICE_SILENT");
  EXPECT_EQ(ErrorReason(set()), "DEVICE_SILENT");
  EXPECT_TRUE(set().ok());
  EXPECT_EQ(over.lights.connects, 2);
}

TEST(LinkedLamps, CheckSaysWhatTheLinkSaysAndNothingOfWhatWasNotConfirmed) {
  LampsOverLights over;
  auto lamps = *over.Open();
  auto check = [&] {
    Pending<std::monostate> done(over.clock());
    lamps->Check(over.clock().Now() + seconds(20), done.sink());
    return done.Wait(kNever, "Check").status();
  };
  auto set = [&] {
    Pending<LampsState> done(over.clock());
    lamps->Set(std::vector<float>(5, 1.0f), over.clock().Now() + seconds(20), done.sink());
    return done.Wait(kNever, "Set").status();
  };
  EXPECT_TRUE(check().ok()) << "dark, as it was opened";
  ASSERT_TRUE(set().ok());
  EXPECT_TRUE(check().ok());
  over.lights.check = Fault(absl::StatusCode::kUnavailable, "DEVICE_LOST");
  EXPECT_EQ(ErrorReason(check()), "DEVICE_LOST");
  over.lights.check = absl::OkStatus();
  EXPECT_EQ(ErrorReason(check()), "LIGHT_UNKNOWN") << "until it is told anew";
  ASSERT_TRUE(set().ok());
  EXPECT_EQ(over.lights.connects, 2);
  EXPECT_TRUE(check().ok());
  over.lights.next = Fault(absl::StatusCode::kDeadlineExceeded, "DEVICE_SILENT");
  EXPECT_EQ(ErrorReason(set()), "DEVICE_SILENT");
  EXPECT_EQ(ErrorReason(check()), "LIGHT_UNKNOWN");
}

struct Wall {
  RealClock clock;
  Mutex mutex;
  Pattern shown;
};

class WallLink final : public ProjectorLink {
 public:
  explicit WallLink(Wall& wall) : wall_(wall) {}
  absl::Status Connect() override { return Show(Pattern{}); }
  ProjectorInfo info() const override {
    ProjectorInfo info;
    info.width = 64;
    info.height = 48;
    info.settle = milliseconds(3);
    return info;
  }
  absl::Status Show(const Pattern& pattern) override {
    SleepFor(wall_.clock, milliseconds(2));
    MutexLock lock(&wall_.mutex);
    wall_.shown = pattern;
    return absl::OkStatus();
  }
  absl::Status Check() override { return absl::OkStatus(); }

 private:
  Wall& wall_;
};

struct ProjectorOnWall : ProjectorFixture {
  Clock& clock() override { return wall.clock; }
  absl::StatusOr<std::unique_ptr<Projector>> Open() override {
    return OpenLinkedProjector({"projector", &wall.clock, nullptr}, "thought",
                               std::make_unique<WallLink>(wall));
  }
  std::optional<Pattern> OnWall() override {
    MutexLock lock(&wall.mutex);
    return wall.shown;
  }
  Wall wall;
};

const bool kProjectors =
    RegisterProjectorConformance("Linked", [] { return std::make_unique<ProjectorOnWall>(); });

// ---- A call on the wire that does not come back: whoever waits is told at the deadline all the same

template <class State>
void ExpectLate(Clock& clock, absl::FunctionRef<void(TimePoint deadline, Completion<State>)> call) {
  const TimePoint deadline = clock.Now() + milliseconds(50);
  Pending<State> done(clock);
  call(deadline, done.sink());
  const absl::Status late = done.Wait(clock.Now() + seconds(20), "the answer").status();
  EXPECT_EQ(ErrorReason(late), "DEVICE_SILENT") << late;
  EXPECT_GE(clock.Now(), deadline);
}

TEST(StuckLink, OfAnAxisIsToldAtTheDeadline) {
  AxisOverDrive over(true);
  auto axis = *over.Open();
  MutexLock stuck(&over.drive.mutex);
  ExpectLate<AxisState>(over.clock(), [&](TimePoint deadline, Completion<AxisState> done) {
    axis->Home(deadline, std::move(done));
  });
  ExpectLate<AxisState>(over.clock(), [&](TimePoint deadline, Completion<AxisState> done) {
    axis->Move(Degrees(10), 0, deadline, std::move(done));
  });
  ExpectLate<AxisState>(over.clock(), [&](TimePoint deadline, Completion<AxisState> done) {
    axis->Read(deadline, std::move(done));
  });
  ExpectLate<AxisState>(over.clock(), [&](TimePoint deadline, Completion<AxisState> done) {
    axis->Stop(deadline, std::move(done));
  });
}

TEST(StuckLink, OfLampsIsToldAtTheDeadline) {
  LampsOverLights over;
  auto lamps = *over.Open();
  MutexLock stuck(&over.lights.mutex);
  ExpectLate<LampsState>(over.clock(), [&](TimePoint deadline, Completion<LampsState> done) {
    lamps->Set({1, 1, 1, 1, 1}, deadline, std::move(done));
  });
  ExpectLate<LampsState>(over.clock(), [&](TimePoint deadline, Completion<LampsState> done) {
    lamps->Dark(deadline, std::move(done));
  });
}

TEST(StuckLink, OfAProjectorIsToldAtTheDeadline) {
  ProjectorOnWall over;
  auto projector = *over.Open();
  MutexLock stuck(&over.wall.mutex);
  Pattern full;
  full.arrangement = PatternArrangement::kFull;
  ExpectLate<ProjectorState>(over.clock(),
                             [&](TimePoint deadline, Completion<ProjectorState> done) {
                               projector->Show(full, deadline, std::move(done));
                             });
  ExpectLate<ProjectorState>(over.clock(),
                             [&](TimePoint deadline, Completion<ProjectorState> done) {
                               projector->Black(deadline, std::move(done));
                             });
}

TEST(StuckLink, InOpeningOrClosingIsLogged) {
  const auto sink = std::make_shared<spdlog::sinks::ringbuffer_sink_mt>(64);
  const std::shared_ptr<spdlog::logger> before = spdlog::default_logger();
  spdlog::set_default_logger(std::make_shared<spdlog::logger>("test", sink));
  RealClock clock;
  DeviceThread thread("lamps", clock);
  std::atomic<bool> stuck = true;
  const auto hang = [&] {
    while (stuck) SleepFor(clock, milliseconds(2));
    return absl::OkStatus();
  };
  const auto until_logged = [&](const std::string& what) {
    const TimePoint give_up = clock.Now() + seconds(30);
    for (bool logged = false; !logged && clock.Now() < give_up;) {
      SleepFor(clock, milliseconds(10));
      for (const std::string& line : sink->last_formatted()) {
        logged |= line.find(what) != std::string::npos;
      }
    }
    stuck = false;
    return clock.Now() < give_up;
  };
  std::thread opens([&] { EXPECT_TRUE(thread.Call(hang).ok()); });
  EXPECT_TRUE(until_logged("lamps: its driver's call has not come back for 5 s"));
  opens.join();
  stuck = true;
  thread.Post([&] { hang().IgnoreError(); });
  std::thread closes([&] { thread.Close(); });
  EXPECT_TRUE(until_logged("closed after has not come back for 5 s"));
  closes.join();
  spdlog::set_default_logger(before);
}

}  // namespace
}  // namespace lightstage
