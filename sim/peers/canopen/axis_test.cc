// The axis of the canopen driver over a simulated drive: what really turns, and every fault that the drive or the bus can have.
#include "drivers/canopen/axis.h"

#include <gmock/gmock.h>

#include "base/env.h"
#include "drivers/conformance/unplug.h"
#include "sim/peers/canopen/test_bench.h"

namespace lightstage::sim {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::HasSubstr;

class CanopenAxisTest : public testing::Test {
 protected:
  void Open(const DriveOptions& drive = {}, const std::string& more = "") {
    bench_.AddDrive(drive);
    absl::StatusOr<std::unique_ptr<Axis>> axis =
        bench_.OpenAxis(std::string(kPatient) + kTurntable + more);
    ASSERT_TRUE(axis.ok()) << axis.status();
    axis_ = *std::move(axis);
  }
  // With a heartbeat that is missed soon.
  void OpenImpatient() {
    bench_.AddDrive();
    absl::StatusOr<std::unique_ptr<Axis>> axis = bench_.OpenAxis(
        std::string("interface = \"can0\"\nanswer_ms = 1000\nheartbeat_ms = 1500\n") + kTurntable);
    ASSERT_TRUE(axis.ok()) << axis.status();
    axis_ = *std::move(axis);
  }
  absl::Status Home() {
    Pending<AxisState> done(bench_.clock());
    axis_->Home(bench_.Soon(), done.sink());
    return done.Wait(kNever, "Home").status();
  }
  absl::StatusOr<AxisState> Read() {
    Pending<AxisState> done(bench_.clock());
    axis_->Read(bench_.Soon(), done.sink());
    return done.Wait(kNever, "Read");
  }
  absl::Status Stop() {
    Pending<AxisState> done(bench_.clock());
    axis_->Stop(bench_.Soon(), done.sink());
    return done.Wait(kNever, "Stop").status();
  }
  Pending<AxisState> Start(double degrees, double dps = 0) {
    Pending<AxisState> done(bench_.clock());
    axis_->Move(Degrees(degrees), dps, bench_.Soon(), done.sink());
    return done;
  }
  absl::Status Move(double degrees, double dps = 0) {
    return Start(degrees, dps).Wait(kNever, "Move").status();
  }
  Pending<AxisState> Turn(double dps) {
    Pending<AxisState> done(bench_.clock());
    axis_->Turn(dps, bench_.Soon(), done.sink());
    return done;
  }
  bool Turns(double dps) {
    return bench_.Becomes([&] { return std::abs(bench_.Truth().velocity_dps - dps) < 0.06; });
  }
  bool BecomesMoving() {
    return bench_.Becomes([&] { return bench_.Truth().velocity_dps != 0; });
  }

  TestBench bench_;
  std::unique_ptr<Axis> axis_;
};

TEST_F(CanopenAxisTest, TurnsWhatIsInTheWorld) {
  Open({.home_deg = 12}, "zero_deg = 12\n");
  ASSERT_TRUE(Home().ok());
  EXPECT_NEAR(bench_.Truth().position.degrees(), 12, 0.01);
  ASSERT_TRUE(Move(90).ok());
  EXPECT_NEAR(bench_.Truth().position.degrees(), 90, 0.01);
  auto moving = Start(180, 20);
  ASSERT_TRUE(BecomesMoving());
  ASSERT_TRUE(bench_.Becomes([&] { return bench_.Truth().velocity_dps > 19.95; }));
  EXPECT_NEAR(bench_.Truth().velocity_dps, 20, 0.1) << "the asked velocity, in the drive's units";
  const absl::StatusOr<AxisState> state = Read();
  ASSERT_TRUE(state.ok()) << state.status();
  EXPECT_TRUE(state->moving);
  EXPECT_NEAR(state->velocity_dps, 20, 0.1);
  EXPECT_TRUE(Stop().ok());
  EXPECT_FALSE(bench_.Truth().moving);
  EXPECT_EQ(axis_->info().identity.serial, "4711");
  EXPECT_THAT(axis_->info().identity.model, HasSubstr("lightstaged drive"));
}

TEST_F(CanopenAxisTest, HasNoPowerUntilHomedAndNoneOnceClosed) {
  Open();
  EXPECT_EQ(bench_.drive().statusword() & 0x4F, 0x40) << "switch on disabled";
  ASSERT_TRUE(Home().ok());
  EXPECT_EQ(bench_.drive().statusword() & 0x6F, 0x27) << "operation enabled";
  axis_.reset();
  EXPECT_EQ(bench_.drive().statusword() & 0x6F, 0x21) << "ready to switch on";
  EXPECT_EQ(bench_.drive().node().Value(0x1016, 1), 0u) << "does not watch us any more";
}

TEST_F(CanopenAxisTest, TurnsInProfileVelocityModeBothWays) {
  Open();
  ASSERT_TRUE(Home().ok());
  auto left = Turn(-30);
  ASSERT_TRUE(Turns(-30));
  EXPECT_EQ(bench_.drive().node().Value(0x6061, 0), 3u);
  ASSERT_TRUE(Stop().ok());
  EXPECT_FALSE(bench_.Truth().moving);
  EXPECT_EQ(ErrorReason(left.Wait(kNever, "Turn").status()), "STOPPED");
  // What is left in the target velocity must not come to life when the mode changes.
  ASSERT_TRUE(Move(20).ok());
  double lowest = 20;
  auto right = Turn(45);
  ASSERT_TRUE(bench_.Becomes([&] {
    lowest = std::min(lowest, bench_.Truth().position.degrees());
    return std::abs(bench_.Truth().velocity_dps - 45) < 0.06;
  }));
  EXPECT_GT(lowest, 19.9);
  const absl::StatusOr<AxisState> state = Read();
  ASSERT_TRUE(state.ok()) << state.status();
  EXPECT_TRUE(state->homed);
  EXPECT_NEAR(state->velocity_dps, 45, 0.1);
  ASSERT_TRUE(Stop().ok());
  ASSERT_TRUE(Move(20).ok());
  EXPECT_NEAR(std::remainder(bench_.Truth().position.degrees() - 20, 360), 0, 0.011);
}

TEST_F(CanopenAxisTest, TurningBackwardsWhereUnitsDo) {
  bench_.AddDrive({.units_per_turn = -36000});
  std::string toml = kTurntable;
  toml.replace(toml.find("36000"), 5, "-36000");
  absl::StatusOr<std::unique_ptr<Axis>> axis = bench_.OpenAxis(kPatient + toml);
  ASSERT_TRUE(axis.ok()) << axis.status();
  axis_ = *std::move(axis);
  ASSERT_TRUE(Home().ok());
  auto turn = Turn(30);
  EXPECT_TRUE(Turns(30));
  EXPECT_TRUE(Stop().ok());
}

TEST_F(CanopenAxisTest, ADriveWithoutProfileVelocityModeSaysSo) {
  Open({.has_velocity_mode = false});
  ASSERT_TRUE(Home().ok());
  const absl::Status turned = Turn(30).Wait(kNever, "Turn").status();
  EXPECT_EQ(ErrorReason(turned), "CANNOT_TURN") << turned;
  EXPECT_THAT(turned.message(), HasSubstr("6502h: 00000021h"));
  EXPECT_TRUE(Move(20).ok()) << "nothing moved";
  // Without 606Ch it is still known whether it moves.
  auto moving = Start(170, 20);
  ASSERT_TRUE(bench_.Becomes([&] { return bench_.Truth().velocity_dps > 19.95; }));
  const absl::StatusOr<AxisState> state = Read();
  ASSERT_TRUE(state.ok()) << state.status();
  EXPECT_TRUE(state->moving);
  EXPECT_NEAR(state->velocity_dps, 20, 5);
  EXPECT_TRUE(Stop().ok());
  EXPECT_FALSE(bench_.Truth().moving);
}

TEST_F(CanopenAxisTest, ATurnThatCouldNotBeTrustedIsRefusedAtRest) {
  Open();
  ASSERT_TRUE(Home().ok());
  // 36000 units a turn in 32 bits: 59652 turns. At 360 deg/s that are 16.6 hours.
  Pending<AxisState> far(bench_.clock());
  axis_->Turn(360, bench_.clock().Now() + std::chrono::hours(17), far.sink());
  const absl::Status wraps = far.Wait(kNever, "Turn").status();
  EXPECT_EQ(ErrorReason(wraps), "AXIS_LIMIT") << wraps;
  EXPECT_EQ(ErrorReason(Turn(0.001).Wait(kNever, "Turn").status()), "AXIS_VELOCITY")
      << "a tenth of a velocity unit";
  EXPECT_FALSE(bench_.Truth().moving);
  EXPECT_TRUE(Move(20).ok()) << "the reference is still good";
}

// Slower than what counts as standing.
TEST_F(CanopenAxisTest, ASlowTurnIsNoStall) {
  Open();
  ASSERT_TRUE(Home().ok());
  auto slow = Turn(0.03);
  SleepFor(bench_.clock(), milliseconds(1500));
  EXPECT_FALSE(slow.done());
  EXPECT_TRUE(Stop().ok());
  EXPECT_GT(bench_.Truth().position.degrees(), 0.005);
}

TEST_F(CanopenAxisTest, ADriveThatDoesNotWatchUsIsNotTurned) {
  Open({.has_abort_option = false});
  ASSERT_TRUE(Home().ok());
  const absl::Status turned = Turn(30).Wait(kNever, "Turn").status();
  EXPECT_EQ(ErrorReason(turned), "CANNOT_TURN") << turned;
  EXPECT_THAT(turned.message(), HasSubstr("6007h"));
}

TEST_F(CanopenAxisTest, ATurnThatIsHeldUpIsSaid) {
  Open();
  ASSERT_TRUE(Home().ok());
  auto slips = Turn(30);
  ASSERT_TRUE(Turns(30));
  bench_.drive().SetSlips(true);
  const absl::Status slipped = slips.Wait(kNever, "Turn").status();
  EXPECT_EQ(ErrorReason(slipped), "DEVICE_FAULT") << slipped;
  EXPECT_THAT(slipped.message(), HasSubstr("slippage"));
  bench_.drive().SetSlips(false);
  ASSERT_TRUE(bench_.Becomes([&] { return !bench_.Truth().moving; })) << "it must be halted";
  EXPECT_EQ(ErrorReason(Turn(30).Wait(kNever, "Turn").status()), "NOT_HOMED");
  ASSERT_TRUE(Home().ok());
  auto stalls = Turn(30);
  ASSERT_TRUE(Turns(30));
  bench_.drive().Jam();
  EXPECT_EQ(ErrorReason(stalls.Wait(kNever, "Turn").status()), "AXIS_STALLED");
}

TEST_F(CanopenAxisTest, ATurnEndsWhenNobodyCommandsItAnyMore) {
  OpenImpatient();
  ASSERT_TRUE(Home().ok());
  auto turn = Turn(30);
  ASSERT_TRUE(Turns(30));
  bench_.wire().SetState(bench_.master(), canopen::CanState::kBusOff);
  EXPECT_TRUE(bench_.Becomes([&] { return !bench_.Truth().moving; }));
  EXPECT_EQ(bench_.drive().statusword() & 0x6F, 0x07) << "quick stop active";
}

TEST_F(CanopenAxisTest, StopsByQuickStopIfItIsToldTo) {
  Open({}, "stop = \"quick-stop\"\n");
  ASSERT_TRUE(Home().ok());
  auto moving = Start(170, 30);
  ASSERT_TRUE(BecomesMoving());
  ASSERT_TRUE(Stop().ok());
  EXPECT_EQ(bench_.drive().statusword() & 0x6F, 0x07) << "quick stop active";
  EXPECT_TRUE(Move(20).ok()) << "enabled anew";
}

// With the times that a rig file has if it says nothing.
TEST_F(CanopenAxisTest, UnpluggedIsToldWithinASecondAndKeepsNothingOpen) {
  bench_.AddDrive();
  absl::StatusOr<std::unique_ptr<Axis>> axis =
      bench_.OpenAxis(std::string("interface = \"can0\"\n") + kTurntable);
  ASSERT_TRUE(axis.ok()) << axis.status();
  axis_ = *std::move(axis);
  ASSERT_TRUE(Home().ok());
  double target = 20;
  for (bool interface : {false, true}) {
    CheckUnplugging(bench_.clock(), "turntable",
                    {.plug =
                         [&](bool plugged) {
                           if (interface) {
                             bench_.wire().SetPresent(plugged);
                             if (plugged) bench_.AddDrive();  // its end was unplugged as well
                           } else {
                             bench_.drive().node().SetSilent(!plugged);
                           }
                         },
                     .use = [&] { return Move(target = 50 - target); },
                     .recover = [&] { return Home(); }});
  }
}

// Lifting the halt bit alone would let the drive go on to where it was going before.
TEST_F(CanopenAxisTest, WhatWasStoppedDoesNotGoOn) {
  Open();
  ASSERT_TRUE(Home().ok());
  auto interrupted = Start(170, 30);
  ASSERT_TRUE(BecomesMoving());
  SleepFor(bench_.clock(), milliseconds(100));
  ASSERT_TRUE(Stop().ok());
  const double stopped = bench_.Truth().position.degrees();
  ASSERT_GT(stopped, 0.5);
  auto back = Start(0, 30);
  double highest = 0;
  ASSERT_TRUE(bench_.Becomes([&] {
    highest = std::max(highest, bench_.Truth().position.degrees());
    return back.done();
  }));
  EXPECT_TRUE(back.Wait(kNever, "Move").ok());
  EXPECT_LT(highest, stopped + 0.05);
}

TEST_F(CanopenAxisTest, SilentNodeIsLostAndFoundAgainByHoming) {
  OpenImpatient();
  ASSERT_TRUE(Home().ok());
  bench_.drive().node().SetSilent(true);
  absl::Status lost;
  ASSERT_TRUE(bench_.Becomes([&] {
    lost = Read().status();
    return ErrorReason(lost) == "DEVICE_LOST";
  })) << lost;
  EXPECT_THAT(lost.message(), HasSubstr("node 5 on can0"));
  EXPECT_EQ(lost.code(), absl::StatusCode::kUnavailable);
  EXPECT_FALSE(Home().ok()) << "nobody answers yet";
  bench_.drive().node().SetSilent(false);
  EXPECT_EQ(ErrorReason(Move(10)), "DEVICE_LOST") << "where it is now nobody knows";
  EXPECT_TRUE(Home().ok());
  EXPECT_TRUE(Move(10).ok());
}

TEST_F(CanopenAxisTest, SilenceOnTheWayEndsTheMove) {
  OpenImpatient();
  ASSERT_TRUE(Home().ok());
  auto moving = Start(170, 20);
  ASSERT_TRUE(BecomesMoving());
  bench_.drive().node().SetSilent(true);
  const absl::Status ended = moving.Wait(kNever, "Move").status();
  // Whichever is over first: the wait for an answer or for the heartbeat.
  EXPECT_THAT(ErrorReason(ended), testing::AnyOf("DEVICE_SILENT", "DEVICE_LOST")) << ended;
  // The drive does not hear us either.
  EXPECT_TRUE(bench_.Becomes([&] { return !bench_.Truth().moving; }));
  EXPECT_LT(bench_.Truth().position.degrees(), 169);
}

TEST_F(CanopenAxisTest, FaultAndEmergencyAreNamedAndClearedByHoming) {
  Open();
  ASSERT_TRUE(Home().ok());
  auto moving = Start(170, 20);
  ASSERT_TRUE(BecomesMoving());
  bench_.drive().Fail(0x8611);
  const absl::Status failed = moving.Wait(kNever, "Move").status();
  EXPECT_EQ(ErrorReason(failed), "DEVICE_FAULT") << failed;
  EXPECT_EQ(failed.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(failed.message(), HasSubstr("error code 8611h"));
  EXPECT_THAT(failed.message(), HasSubstr("emergency 8611h (monitoring)"));
  EXPECT_EQ(ErrorReason(Move(10)), "DEVICE_FAULT") << "still";
  EXPECT_TRUE(Home().ok());
  EXPECT_TRUE(Move(10).ok());
  bench_.drive().SetFollowingError(true);
  const absl::Status other = Move(20);
  EXPECT_THAT(other.message(), testing::Not(HasSubstr("emergency"))) << "that one is over";
}

TEST_F(CanopenAxisTest, EmergencyThatStopsNothingIsNamedInTheNextError) {
  Open();
  ASSERT_TRUE(Home().ok());
  bench_.drive().node().Emergency(0x4210, 0x08);
  ASSERT_TRUE(Move(10).ok());
  bench_.drive().SetFollowingError(true);
  const absl::Status failed = Move(20);
  EXPECT_EQ(ErrorReason(failed), "DEVICE_FAULT") << failed;
  EXPECT_THAT(failed.message(), HasSubstr("following error"));
  EXPECT_THAT(failed.message(), HasSubstr("4210h (device temperature)"));
}

TEST_F(CanopenAxisTest, FaultThatStaysIsSaid) {
  Open();
  bench_.drive().Fail(0x2310, /*stays=*/true);
  ASSERT_TRUE(bench_.Becomes([&] { return (bench_.drive().statusword() & 0x4F) == 0x08; }));
  const absl::Status failed = Home();
  EXPECT_EQ(ErrorReason(failed), "DEVICE_FAULT") << failed;
  EXPECT_THAT(failed.message(), HasSubstr("2310h"));
}

TEST_F(CanopenAxisTest, LostSetpointIsOfferedOnceMore) {
  Open();
  ASSERT_TRUE(Home().ok());
  bench_.drive().LoseSetpoints(1);
  EXPECT_TRUE(Move(20).ok());
  EXPECT_NEAR(bench_.Truth().position.degrees(), 20, 0.01);
  bench_.drive().LoseSetpoints(2);
  const absl::Status lost = Move(40);
  EXPECT_EQ(ErrorReason(lost), "SETPOINT_NOT_ACKNOWLEDGED") << lost;
  EXPECT_EQ(lost.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_NEAR(bench_.Truth().position.degrees(), 20, 0.01);
  EXPECT_TRUE(Home().ok());
  EXPECT_TRUE(Move(40).ok());
  EXPECT_NEAR(bench_.Truth().position.degrees(), 40, 0.01);
}

TEST_F(CanopenAxisTest, BusOffIsLostAndComesBackByHoming) {
  Open();
  // The move is told at once, however busy the machine is now and then.
  Duration shortest = seconds(30);
  for (int i = 0; i < 5; ++i) {
    absl::Status home = Home();
    ASSERT_TRUE(home.ok()) << home;
    auto moving = Start(170, 20);
    ASSERT_TRUE(BecomesMoving());
    const TimePoint off = bench_.clock().Now();
    bench_.wire().SetState(bench_.master(), canopen::CanState::kBusOff);
    const absl::Status lost = moving.Wait(kNever, "Move").status();
    shortest = std::min(shortest, bench_.clock().Now() - off);
    EXPECT_EQ(lost.code(), absl::StatusCode::kUnavailable) << lost;
    EXPECT_EQ(ErrorReason(lost), "DEVICE_LOST") << lost;
    EXPECT_THAT(lost.message(), HasSubstr("bus-off"));
    home = Home();
    EXPECT_EQ(ErrorReason(home), "DEVICE_LOST") << home;
    bench_.wire().SetState(bench_.master(), canopen::CanState::kActive);
    ASSERT_TRUE(bench_.Becomes([&] { return bench_.bus()->trouble().ok(); }));
    EXPECT_THAT(ErrorReason(Move(10)), testing::AnyOf("DEVICE_LOST", "NOT_HOMED"));
  }
  EXPECT_LT(shortest, milliseconds(100));
  const absl::Status home = Home();
  EXPECT_TRUE(home.ok()) << home;
  EXPECT_TRUE(Move(10).ok());
}

// The daemon's end falls silent: the drive brakes by itself.
TEST_F(CanopenAxisTest, DriveStopsWhenNobodyCommandsIt) {
  OpenImpatient();
  ASSERT_TRUE(Home().ok());
  auto moving = Start(170, 20);
  ASSERT_TRUE(BecomesMoving());
  bench_.wire().SetState(bench_.master(), canopen::CanState::kBusOff);
  ASSERT_TRUE(bench_.Becomes([&] { return !bench_.Truth().moving; }));
  EXPECT_LT(bench_.Truth().position.degrees(), 169);
  EXPECT_EQ(bench_.drive().statusword() & 0x6F, 0x07) << "quick stop active";
}

TEST_F(CanopenAxisTest, InterfaceThatGoesIsOpenedAnew) {
  Open();
  ASSERT_TRUE(Home().ok());
  bench_.wire().SetPresent(false);
  absl::Status lost;
  ASSERT_TRUE(bench_.Becomes([&] {
    lost = Read().status();
    return ErrorReason(lost) == "DEVICE_LOST";
  })) << lost;
  EXPECT_FALSE(Home().ok());
  bench_.wire().SetPresent(true);
  bench_.AddDrive();  // its end was unplugged as well
  const absl::Status home = Home();
  EXPECT_TRUE(home.ok()) << home;
  EXPECT_TRUE(Move(10).ok());
}

TEST_F(CanopenAxisTest, RebootLosesTheReference) {
  Open();
  ASSERT_TRUE(Home().ok());
  ASSERT_TRUE(Move(30).ok());
  bench_.drive().node().Reboot();
  absl::Status lost;
  ASSERT_TRUE(bench_.Becomes([&] {
    lost = Read().status();
    return !lost.ok();
  }));
  EXPECT_EQ(ErrorReason(lost), "DEVICE_LOST") << lost;
  EXPECT_THAT(lost.message(), HasSubstr("booted"));
  EXPECT_EQ(ErrorReason(Move(10)), "DEVICE_LOST");
  EXPECT_TRUE(Home().ok());
  EXPECT_TRUE(Move(10).ok());
  EXPECT_NEAR(bench_.Truth().position.degrees(), 10, 0.01);
}

TEST_F(CanopenAxisTest, AnotherDriveInItsPlaceIsRefused) {
  Open();
  ASSERT_TRUE(Home().ok());
  bench_.drive().node().SetSilent(true);
  DriveOptions other;
  other.identity.serial = 4712;
  bench_.AddDrive(other);  // boots
  ASSERT_TRUE(bench_.Becomes([&] { return ErrorReason(Read().status()) == "DEVICE_LOST"; }));
  const absl::Status refused = Home();
  EXPECT_EQ(ErrorReason(refused), "DEVICE_UNSUITABLE") << refused;
  EXPECT_THAT(refused.message(), HasSubstr("4711"));
  EXPECT_THAT(refused.message(), HasSubstr("4712"));
}

TEST_F(CanopenAxisTest, WrongNodesAreNamed) {
  bench_.AddOutputs();
  const std::string toml = std::string(kPatient) + kTurntable;
  std::string at_nine = toml;
  at_nine.replace(at_nine.find("node = 5"), 8, "node = 9");
  absl::Status wrong = bench_.OpenAxis(at_nine).status();
  EXPECT_EQ(ErrorReason(wrong), "DEVICE_UNSUITABLE") << wrong;
  EXPECT_THAT(wrong.message(), HasSubstr("a CiA 401 I/O module"));
  EXPECT_THAT(wrong.message(), HasSubstr("must be a CiA 402 drive"));

  bench_.AddDrive();
  wrong = bench_.OpenAxis(toml + "vendor_id = 0x9A\n").status();
  EXPECT_EQ(ErrorReason(wrong), "DEVICE_UNSUITABLE") << wrong;
  EXPECT_THAT(wrong.message(), HasSubstr("0x0000009A"));
  wrong = bench_.OpenAxis(toml + "serial_number = 1\n").status();
  EXPECT_EQ(ErrorReason(wrong), "DEVICE_UNSUITABLE") << wrong;

  std::string at_six = std::string("interface = \"can0\"\nanswer_ms = 50\n") + kTurntable;
  at_six.replace(at_six.find("node = 5"), 8, "node = 6");
  EXPECT_EQ(ErrorReason(bench_.OpenAxis(at_six).status()), "DEVICE_SILENT");
}

TEST_F(CanopenAxisTest, DrivesOwnLimitsMustHoldTheRigs) {
  bench_.AddDrive({.software_limits = {{0, 9000}}});
  const std::string rest =
      "node = 5\nunits_per_turn = 36000\nmax_velocity_dps = 360\nmax_acceleration_dps2 = 3600\n"
      "homing_method = 17\nhoming_velocity_dps = 360\n";
  absl::Status refused = bench_.OpenAxis(kPatient + rest + "min_deg = 0\nmax_deg = 120\n").status();
  EXPECT_EQ(ErrorReason(refused), "DEVICE_UNSUITABLE") << refused;
  EXPECT_THAT(refused.message(), HasSubstr("0 to 90 deg"));
  EXPECT_THAT(refused.message(), HasSubstr("0 to 120 deg"));
  refused = bench_.OpenAxis(kPatient + rest + "continuous = true\n").status();
  EXPECT_EQ(ErrorReason(refused), "DEVICE_UNSUITABLE") << refused;
  EXPECT_TRUE(bench_.OpenAxis(kPatient + rest + "min_deg = 0\nmax_deg = 90\n").ok());
}

TEST_F(CanopenAxisTest, HomingThatFailsIsSaid) {
  Open();
  bench_.drive().FailNextHoming();
  const absl::Status failed = Home();
  EXPECT_EQ(ErrorReason(failed), "HOMING_FAILED") << failed;
  EXPECT_EQ(ErrorReason(Move(10)), "NOT_HOMED");
  EXPECT_TRUE(Home().ok());
  ASSERT_TRUE(Move(10).ok());
  // What is left of an earlier good homing is not taken for the end of this one.
  bench_.drive().FailNextHoming();
  EXPECT_EQ(ErrorReason(Home()), "HOMING_FAILED");
}

TEST_F(CanopenAxisTest, PowerThatIsCutOnTheWayIsSaid) {
  Open();
  ASSERT_TRUE(Home().ok());
  auto moving = Start(170, 20);
  ASSERT_TRUE(BecomesMoving());
  bench_.drive().CutPower();
  const absl::Status failed = moving.Wait(kNever, "Move").status();
  EXPECT_EQ(ErrorReason(failed), "DEVICE_FAULT") << failed;
  EXPECT_THAT(failed.message(), HasSubstr("switch on disabled"));
  EXPECT_TRUE(Home().ok()) << "it is enabled again";
  EXPECT_TRUE(Move(10).ok());
}

TEST_F(CanopenAxisTest, DataSheetsLimitsAreKept) {
  const std::string path = testing::TempDir() + "/canopen_axis_test.eds";
  ASSERT_TRUE(PosixEnv()
                  .WriteFile(path,
                             "[DeviceInfo]\nVendorNumber=0x17F\n[1017]\nDataType=6\nAccessType=rw\n"
                             "[1016sub1]\nDataType=7\nAccessType=rw\n[6040]\nDataType=6\n"
                             "AccessType=rww\n[6060]\nDataType=2\nAccessType=rw\n[607A]\n"
                             "DataType=4\nAccessType=rww\nLowLimit=0xFFFFF000\nHighLimit=18000\n"
                             "[6081]\nParameterName=Profile Velocity\nDataType=7\nAccessType=rw\n"
                             "HighLimit=3000\n[6083]\nDataType=7\nAccessType=rw\n[6084]\n"
                             "DataType=7\nAccessType=rw\n[6098]\nDataType=2\nAccessType=rw\n"
                             "[6099sub1]\nDataType=7\nAccessType=rw\n[6099sub2]\nDataType=7\n"
                             "AccessType=rw\n")
                  .ok());
  Open({}, "eds = \"" + path + "\"\n");
  ASSERT_TRUE(Home().ok());
  EXPECT_TRUE(Move(30, 20).ok());
  const absl::Status refused = Move(60, 40);
  EXPECT_EQ(ErrorReason(refused), "OBJECT_LIMIT") << refused;
  EXPECT_THAT(refused.message(), HasSubstr("Profile Velocity"));
  EXPECT_EQ(bench_.drive().node().Value(0x6081, 0), 2000u) << "not written";
  EXPECT_EQ(ErrorReason(Move(-90, 20)), "OBJECT_LIMIT") << "below LowLimit, given as 32 bits";
  EXPECT_EQ(bench_.drive().node().Value(0x6007, 0), 0u) << "not in the data sheet";
}

TEST_F(CanopenAxisTest, LateAnswersAreNotTakenForOthers) {
  bench_.AddDrive();
  canopen::Node node("turntable", bench_.bus(), 5, milliseconds(400), nullptr);
  ASSERT_TRUE(node.Attach().ok());
  EXPECT_EQ(*node.ReadUnsigned({0x1018, 4}), 4711u);
  bench_.drive().node().DelayAnswers(milliseconds(1200));
  const absl::Status late = node.ReadUnsigned({0x1018, 4}).status();
  EXPECT_EQ(ErrorReason(late), "DEVICE_SILENT") << late;
  EXPECT_THAT(late.message(), HasSubstr("1018h:04"));
  bench_.drive().node().Do([](ObjectDictionary& objects) {
    objects.Constant(0x1018, 4, 4, 99);  // what is true from now on
  });
  bench_.drive().node().DelayAnswers({});
  absl::StatusOr<uint32_t> serial = absl::UnknownError("not read");
  ASSERT_TRUE(bench_.Becomes([&] {
    serial = node.ReadUnsigned({0x1018, 4});
    return serial.ok();
  })) << serial.status();
  EXPECT_EQ(*serial, 99u);
}

TEST_F(CanopenAxisTest, LongValuesGoInSegments) {
  bench_.AddDrive();
  canopen::Node node("turntable", bench_.bus(), 5, seconds(1), nullptr);
  ASSERT_TRUE(node.Attach().ok());
  for (const std::string text :
       {"", "12345", "1234567", "12345678", "a text of more than four times seven bytes"}) {
    const std::vector<uint8_t> bytes(text.begin(), text.end());
    ASSERT_TRUE(node.Write({0x100A, 0}, bytes).ok()) << text;
    EXPECT_EQ(bench_.drive().node().TextOf(0x100A, 0), text);
    absl::StatusOr<std::vector<uint8_t>> back = node.Read({0x100A, 0});
    ASSERT_TRUE(back.ok()) << back.status();
    EXPECT_EQ(*back, bytes);
  }
  EXPECT_EQ(ErrorReason(node.Read({0x2000, 0}).status()), "OBJECT_MISSING");
  EXPECT_EQ(ErrorReason(node.WriteInteger({0x1000, 0}, 1, 4)), "SDO_ABORTED");
  EXPECT_THAT(node.WriteInteger({0x1000, 0}, 1, 4).message(), HasSubstr("read-only"));
}

TEST_F(CanopenAxisTest, TwoDevicesCanNotBeOneNode) {
  Open();
  const absl::Status taken = bench_.OpenAxis(std::string(kPatient) + kTurntable).status();
  EXPECT_EQ(ErrorReason(taken), "NODE_TAKEN") << taken;
  EXPECT_TRUE(Home().ok()) << "the first is not disturbed";
}

TEST_F(CanopenAxisTest, StatusComesByPdoWhereThatCanBeMapped) {
  bench_.AddDrive();
  canopen::CanopenAxisLink link("turntable", AxisToml(std::string(kPatient) + kTurntable),
                                bench_.bus());
  ASSERT_TRUE(link.Connect().ok());
  EXPECT_TRUE(link.by_pdo());
  EXPECT_EQ(bench_.drive().node().Value(0x1A00, 1), 0x60410010u);
  EXPECT_EQ(bench_.drive().node().Value(0x1A00, 2), 0x60640020u);
  EXPECT_EQ(bench_.drive().node().Value(0x1800, 5), 5u) << "event timer, ms";
}

}  // namespace
}  // namespace lightstage::sim
