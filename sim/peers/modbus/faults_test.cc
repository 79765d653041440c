// What goes wrong on wires and in drives, and what the driver makes of it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "drivers/conformance/private_network.h"
#include "drivers/conformance/unplug.h"
#include "drivers/modbus/client.h"
#include "sim/peers/modbus/test_bench.h"

namespace lightstage::sim {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::ElementsAre;
using testing::HasSubstr;

[[maybe_unused]] const bool kPrivateNetwork = EnterPrivateNetwork();

// ---- Wires

class WireTest : public testing::TestWithParam<Wire> {
 protected:
  WireTest() {
    drive_ = *ModbusDrivePeer::Create({}, bench_.world());
    EXPECT_TRUE(bench_.Serve(GetParam(), {{1, drive_}}).ok());
    if (GetParam() == Wire::kTcp) {
      line_.host = "127.0.0.1";
      line_.port = bench_.server().port();
    } else {
      line_.serial_port = bench_.server().serial_port();
    }
    line_.response_timeout = milliseconds(500);
    client_.emplace(line_, 1, "turntable", bench_.clock());
    EXPECT_TRUE(client_->Connect().ok());
    EXPECT_TRUE(client_->WriteRegisters(16, std::vector<uint16_t>{111, 222, 333}).ok());
  }
  ModbusServer& server() { return bench_.server(); }
  std::string ReasonOfRead() { return ErrorReason(client_->ReadRegisters(16, 1).status()); }

  ModbusBench bench_;
  std::shared_ptr<ModbusDrivePeer> drive_;
  LineOptions line_;
  std::optional<ModbusClient> client_;
};

INSTANTIATE_TEST_SUITE_P(Wires, WireTest, testing::Values(Wire::kTcp, Wire::kRtu),
                         [](const auto& info) { return info.param == Wire::kTcp ? "Tcp" : "Rtu"; });

TEST_P(WireTest, SilenceIsToldAndOver) {
  server().Inject(WireFault::kSilence);
  const absl::Status status = client_->ReadRegisters(16, 1).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kDeadlineExceeded);
  EXPECT_EQ(ErrorReason(status), "DEVICE_SILENT");
  EXPECT_THAT(MessageOf(status), HasSubstr("no answer within 500 ms"));
  EXPECT_EQ(ReasonOfRead(), "OK");
}

TEST_P(WireTest, ALateReplyIsNotTakenForAnother) {
  for (int late_ms : {700, 800, 950}) {  // of 500, and a frame's time on a line
    server().Inject(WireFault::kLate, 1, late_ms);
    EXPECT_EQ(ErrorReason(client_->ReadRegisters(16, 1).status()), "DEVICE_SILENT");
    // Of the same shape as the one that is late.
    const auto read = client_->ReadRegisters(17, 1);
    ASSERT_TRUE(read.ok()) << read.status();
    EXPECT_THAT(*read, ElementsAre(222)) << late_ms;
    EXPECT_THAT(client_->ReadRegisters(18, 1).value(), ElementsAre(333)) << late_ms;
  }
}

// Each byte is in time, the answer is not: what waits behind it, a stop maybe, must not wait for its end.
TEST_P(WireTest, AnAnswerThatDribblesIsSilence) {
  server().Inject(WireFault::kDribble, 1, 150);
  RealClock clock;
  const TimePoint asked = clock.Now();
  EXPECT_EQ(ErrorReason(client_->ReadRegisters(16, 7).status()), "DEVICE_SILENT");
  EXPECT_LT(clock.Now() - asked, seconds(2));  // all of it takes 2.8 s and more
  // Whoever connects while it is at it finds nobody who accepts.
  while (!client_->ReadRegisters(17, 1).ok() && clock.Now() - asked < seconds(60)) {
    static_cast<void>(client_->Connect());
  }
  EXPECT_THAT(client_->ReadRegisters(17, 1).value(), ElementsAre(222));
}

TEST_P(WireTest, GarbageIsAskedForAgainAFewTimes) {
  const int before = server().requests();
  server().Inject(WireFault::kGarbage, 2);
  const auto read = client_->ReadRegisters(17, 1);
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_THAT(*read, ElementsAre(222));
  EXPECT_EQ(server().requests() - before, 3);
  server().Inject(WireFault::kGarbage, 3);
  const absl::Status status = client_->ReadRegisters(17, 1).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kDataLoss);
  EXPECT_EQ(ErrorReason(status), "MODBUS_GARBLED");
  EXPECT_THAT(MessageOf(status), HasSubstr("3 times"));
  EXPECT_THAT(client_->ReadRegisters(17, 1).value(), ElementsAre(222));
}

TEST_P(WireTest, HalfAReplyIsNone) {
  server().Inject(WireFault::kTruncated);
  EXPECT_EQ(ReasonOfRead(), "DEVICE_SILENT");
  EXPECT_THAT(client_->ReadRegisters(17, 1).value(), ElementsAre(222));
}

TEST_P(WireTest, AnotherUnitsReplyIsNotTaken) {
  if (GetParam() == Wire::kTcp) return;  // there a transaction's number tells more
  server().Inject(WireFault::kOtherUnit, 3);
  EXPECT_EQ(ReasonOfRead(), "MODBUS_GARBLED");
  server().Inject(WireFault::kOtherUnit, 1);
  EXPECT_THAT(client_->ReadRegisters(17, 1).value(), ElementsAre(222));
}

TEST_P(WireTest, ExceptionsAreNamed) {
  server().Inject(WireFault::kException, 1, 6);
  absl::Status status = client_->WriteRegister(22, 5);
  EXPECT_EQ(ErrorReason(status), "MODBUS_EXCEPTION");
  EXPECT_THAT(MessageOf(status), HasSubstr("exception 6, SERVER DEVICE BUSY"));
  EXPECT_THAT(MessageOf(status),
              HasSubstr("function 6 (write register), register 0x0016 of unit 1"));
  server().Inject(WireFault::kException, 1, 11);
  EXPECT_EQ(ReasonOfRead(), "DEVICE_SILENT") << "the gateway's word for it";
  status = client_->ReadRegisters(1000, 1).status();
  EXPECT_THAT(MessageOf(status), HasSubstr("ILLEGAL DATA ADDRESS"));
  EXPECT_EQ(ReasonOfRead(), "OK");
}

TEST_P(WireTest, WhatGoesAwayIsLostUntilConnectedAnew) {
  server().Unplug();
  const TimePoint begin = bench_.clock().Now();
  EXPECT_EQ(ReasonOfRead(), "DEVICE_LOST");
  EXPECT_EQ(ErrorReason(client_->Connect()), "DEVICE_LOST");
  EXPECT_LT(bench_.clock().Now() - begin, seconds(10)) << "within a second, on an idle machine";
  ASSERT_EQ(server().Plug(), absl::OkStatus());
  EXPECT_EQ(ReasonOfRead(), "DEVICE_LOST") << "what was there may have lost its state";
  ASSERT_TRUE(client_->Connect().ok());
  EXPECT_THAT(client_->ReadRegisters(17, 1).value(), ElementsAre(222));
}

// ---- Drives

class DriveTest : public testing::Test {
 protected:
  void Start(const std::string& kind = "generic", Wire wire = Wire::kTcp,
             const std::string& keys = "") {
    options_.kind = kind;
    drive_ = *ModbusDrivePeer::Create(options_, bench_.world());
    ASSERT_TRUE(bench_.Serve(wire, {{1, drive_}}).ok());
    axis_ = OpenAxis(keys);
  }
  std::unique_ptr<Axis> OpenAxis(const std::string& keys = "") {
    auto axis = bench_.Open(
        ModbusAxisDriver(), "turntable",
        absl::StrCat("profile = \"", options_.kind,
                     "\"\nsteps_per_degree = ", options_.steps_per_degree,
                     "\nmax_velocity_dps = 100\nmax_acceleration_dps2 = 400\nsettle_ms = 0\n"
                     "poll_ms = 5\ntolerance_deg = 0.01\n",
                     keys.empty() ? "min_deg = 0\nmax_deg = 90\n" : keys));
    EXPECT_TRUE(axis.ok()) << axis.status();
    return axis.ok() ? *std::move(axis) : nullptr;
  }
  absl::Status Home() {
    Pending<AxisState> done(bench_.clock());
    axis_->Home(bench_.In(seconds(30)), done.sink());
    return done.Wait(kNever, "Home").status();
  }
  absl::Status Move(double degrees) {
    Pending<AxisState> done(bench_.clock());
    axis_->Move(Degrees(degrees), 0, bench_.In(seconds(30)), done.sink());
    return done.Wait(kNever, "Move").status();
  }
  // Begins a long move and returns when it is on its way.
  std::shared_ptr<Pending<AxisState>> BeginMove(double degrees) {
    auto done = std::make_shared<Pending<AxisState>>(bench_.clock());
    axis_->Move(Degrees(degrees), 30, bench_.In(seconds(30)), done->sink());
    EXPECT_TRUE(bench_.Becomes([&] { return World().moving; }));
    return done;
  }
  AxisState World() { return bench_.world()->AxisAt(AxisRole::kTurntable, bench_.clock().Now()); }
  bool ComesToRest() {
    return bench_.Becomes([&] { return !World().moving; });
  }

  ModbusBench bench_;
  DrivePeerOptions options_;
  std::shared_ptr<ModbusDrivePeer> drive_;
  std::unique_ptr<Axis> axis_;
};

TEST_F(DriveTest, AFaultIsNamedAndClearedByHoming) {
  Start("oriental-motor-az");
  ASSERT_TRUE(Home().ok());
  auto move = BeginMove(80);
  drive_->Fail(0x30);
  absl::Status status = move->Wait(kNever, "Move").status();
  EXPECT_EQ(ErrorReason(status), "DEVICE_FAULT") << status;
  EXPECT_THAT(MessageOf(status), HasSubstr("0x30 (overload)"));
  EXPECT_EQ(ErrorReason(Move(10)), "DEVICE_FAULT") << "moving does not clear it";
  EXPECT_TRUE(Home().ok());
  EXPECT_TRUE(Move(10).ok());
}

TEST_F(DriveTest, AFaultThatStaysIsTold) {
  Start("leadshine-rs", Wire::kRtu);
  drive_->Fail(0x02);
  drive_->FailForGood(true);
  const absl::Status status = Home();
  EXPECT_EQ(ErrorReason(status), "DEVICE_FAULT") << status;
  EXPECT_THAT(MessageOf(status), HasSubstr("0x2 (overvoltage)"));
  drive_->FailForGood(false);
  EXPECT_TRUE(Home().ok());
}

TEST_F(DriveTest, ADriveWithAFaultCanBeOpened) {
  options_.kind = "applied-motion";
  options_.steps_per_rev = 20000;
  drive_ = *ModbusDrivePeer::Create(options_, bench_.world());
  drive_->Fail(0x1000);
  ASSERT_TRUE(bench_.Serve(Wire::kTcp, {{1, drive_}}).ok());
  axis_ = OpenAxis();
  ASSERT_NE(axis_, nullptr);
  EXPECT_THAT(MessageOf(Move(10)), HasSubstr("no move"));
  EXPECT_TRUE(Home().ok());
}

TEST_F(DriveTest, APositionThatStaysIsNoticed) {
  Start();
  ASSERT_TRUE(Home().ok());
  drive_->Freeze(true);
  EXPECT_EQ(ErrorReason(Move(20)), "AXIS_OFF_TARGET");
  const absl::Status status = Home();
  EXPECT_EQ(ErrorReason(status), "DRIVE_IMPLAUSIBLE") << status;
  EXPECT_THAT(MessageOf(status),
              HasSubstr("by 0.5 deg after homing, its position changed by 0 deg"));
  EXPECT_THAT(MessageOf(status), HasSubstr("does not follow"));
  EXPECT_EQ(ErrorReason(Move(20)), "NOT_HOMED") << "though the drive says that it is homed";
  drive_->Freeze(false);
  EXPECT_TRUE(Home().ok());
}

TEST_F(DriveTest, WordsInTheWrongOrderAreFoundByHoming) {
  for (const auto& [position, commands] :
       {std::pair(true, false), std::pair(false, true), std::pair(true, true)}) {
    Start("generic", commands ? Wire::kRtu : Wire::kTcp);
    drive_->SwapWords(position, commands);
    const absl::Status status = Home();
    EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
    EXPECT_EQ(ErrorReason(status), "DRIVE_IMPLAUSIBLE") << position << commands << status;
    EXPECT_TRUE(ComesToRest());
    EXPECT_GE(drive_->halts(), 1);
    EXPECT_LT(std::abs(World().position.degrees()), 400) << "not for ever on the way";
    EXPECT_EQ(ErrorReason(Move(20)), "NOT_HOMED");
    axis_.reset();
  }
}

TEST_F(DriveTest, WrongScalingAndDirectionAreFoundByHoming) {
  Start();
  drive_->Scale(0.5);
  absl::Status status = Home();
  EXPECT_EQ(ErrorReason(status), "DRIVE_IMPLAUSIBLE") << status;
  EXPECT_THAT(MessageOf(status), HasSubstr("0.25 deg"));
  EXPECT_THAT(MessageOf(status), HasSubstr("scaled differently"));
  drive_->Scale(-1);
  status = Home();
  EXPECT_EQ(ErrorReason(status), "DRIVE_IMPLAUSIBLE") << status;
  drive_->Scale(1);
  EXPECT_TRUE(Home().ok());
  EXPECT_TRUE(Move(20).ok());
}

TEST_F(DriveTest, ThePlausibilityMoveStaysWithinTheLimits) {
  Start("generic", Wire::kTcp, "min_deg = -10\nmax_deg = 0.2\n");
  EXPECT_TRUE(Home().ok()) << "its reference is at 0: it goes down";
  Start("generic", Wire::kTcp, "min_deg = -10\nmax_deg = 10\nplausibility_move_deg = 0\n");
  const int before = drive_->moves();
  EXPECT_TRUE(Home().ok());
  EXPECT_EQ(drive_->moves(), before) << "switched off";
}

TEST_F(DriveTest, AHomingThatDoesNotHappenIsNoticed) {
  Start("applied-motion");
  drive_->BeDeaf(true);
  EXPECT_EQ(ErrorReason(Home()), "AXIS_OFF_TARGET");
  drive_->BeDeaf(false);
  EXPECT_EQ(ErrorReason(Move(10)), "NOT_HOMED");
}

TEST_F(DriveTest, AMoveOfWhichNobodyKnowsIsStopped) {
  Start();
  ASSERT_TRUE(Home().ok());
  const int moves = drive_->moves(), halts = drive_->halts();
  // Status and position are read before; then comes the write that starts it.
  bench_.server().Inject(WireFault::kLostReply, 1, 0, 2);
  EXPECT_EQ(ErrorReason(Move(90)), "DEVICE_SILENT");
  EXPECT_EQ(drive_->moves(), moves + 1);
  EXPECT_GT(drive_->halts(), halts);
  EXPECT_TRUE(ComesToRest());
  EXPECT_LT(World().position.degrees(), 85);
  EXPECT_EQ(ErrorReason(Move(30)), "NOT_HOMED") << "it may have been switched off meanwhile";
  EXPECT_TRUE(Home().ok());
  EXPECT_TRUE(Move(30).ok());
  EXPECT_NEAR(World().position.degrees(), 30, 0.01);
}

TEST_F(DriveTest, SilenceOnTheWayEndsTheMoveAndHaltsIt) {
  Start("leadshine-rs", Wire::kRtu);
  ASSERT_TRUE(Home().ok());
  auto move = BeginMove(80);
  bench_.server().Inject(WireFault::kSilence, 1);
  EXPECT_EQ(ErrorReason(move->Wait(kNever, "Move").status()), "DEVICE_SILENT");
  EXPECT_TRUE(ComesToRest());
  EXPECT_LT(World().position.degrees(), 79);
  EXPECT_EQ(ErrorReason(Move(30)), "NOT_HOMED");
  EXPECT_TRUE(Home().ok());
  EXPECT_TRUE(Move(30).ok());
}

// Of a drive that does not say that it has forgotten its reference.
TEST_F(DriveTest, AfterAPowerCutItHasToBeHomed) {
  Start();
  ASSERT_TRUE(Home().ok());
  ASSERT_TRUE(Move(30).ok());
  drive_->PowerCycle();
  Pending<AxisState> read(bench_.clock());
  axis_->Read(bench_.In(seconds(20)), read.sink());
  EXPECT_FALSE(read.Wait(kNever, "Read")->homed);
  EXPECT_EQ(ErrorReason(Move(40)), "NOT_HOMED");
  EXPECT_TRUE(Home().ok());
  EXPECT_TRUE(Move(40).ok());
  EXPECT_NEAR(World().position.degrees(), 40, 0.01);
}

TEST_F(DriveTest, AStopThatIsNotAnsweredIsToldAgain) {
  for (Wire wire : {Wire::kTcp, Wire::kRtu}) {
    Start("generic", wire);
    ASSERT_TRUE(Home().ok());
    auto move = BeginMove(80);
    bench_.server().Inject(WireFault::kSilentWrite, 1);
    Pending<AxisState> stopped(bench_.clock());
    axis_->Stop(bench_.In(seconds(20)), stopped.sink());
    EXPECT_EQ(ErrorReason(move->Wait(kNever, "Move").status()), "STOPPED");
    EXPECT_TRUE(stopped.Wait(kNever, "Stop").ok());
    EXPECT_FALSE(World().moving);
    EXPECT_LT(World().position.degrees(), 79);
    axis_.reset();
  }
}

TEST_F(DriveTest, ALostConnectionComesBackByHoming) {
  for (Wire wire : {Wire::kTcp, Wire::kRtu}) {
    Start("generic", wire);
    ASSERT_TRUE(Home().ok());
    auto move = BeginMove(80);
    bench_.server().Unplug();
    EXPECT_EQ(ErrorReason(move->Wait(kNever, "Move").status()), "DEVICE_LOST");
    EXPECT_EQ(ErrorReason(Move(20)), "DEVICE_LOST");
    EXPECT_EQ(ErrorReason(Home()), "DEVICE_LOST") << "still unplugged";
    ASSERT_EQ(bench_.server().Plug(), absl::OkStatus());
    // By homing only, also once the driver has connected anew to halt it.
    EXPECT_THAT(ErrorReason(Move(20)), testing::AnyOf("DEVICE_LOST", "NOT_HOMED"));
    EXPECT_TRUE(Home().ok());
    EXPECT_TRUE(Move(20).ok());
    axis_.reset();
  }
}

TEST_F(DriveTest, UnpluggedIsToldWithinASecondAndKeepsNothingOpen) {
  for (Wire wire : {Wire::kTcp, Wire::kRtu}) {
    for (bool cable : {false, true}) {  // the cable alone: no connection breaks, but nobody answers
      Start("generic", wire);
      ASSERT_TRUE(Home().ok());
      double target = 20;
      CheckUnplugging(bench_.clock(), "turntable",
                      {.plug =
                           [&](bool plugged) {
                             if (cable) {
                               bench_.server().Inject(WireFault::kSilence, plugged ? 0 : 1000000);
                             } else if (plugged) {
                               EXPECT_EQ(bench_.server().Plug(), absl::OkStatus());
                             } else {
                               bench_.server().Unplug();
                             }
                           },
                       .use = [&] { return Move(target = 50 - target); },
                       .recover = [&] { return Home(); }});
      axis_.reset();
    }
  }
}

TEST_F(DriveTest, AnotherDriveAfterALossIsRefused) {
  Start();
  EXPECT_EQ(axis_->info().identity.serial, "4711");
  ASSERT_TRUE(Home().ok());
  bench_.server().Unplug();
  EXPECT_EQ(ErrorReason(Move(20)), "DEVICE_LOST");
  drive_->SetSerial(4712);
  ASSERT_EQ(bench_.server().Plug(), absl::OkStatus());
  const absl::Status status = Home();
  EXPECT_EQ(ErrorReason(status), "DEVICE_UNSUITABLE");
  EXPECT_THAT(MessageOf(status), HasSubstr("4712"));
}

TEST_F(DriveTest, ADriveThatWasSwitchedOffMustBeHomed) {
  Start();
  ASSERT_TRUE(Home().ok());
  ASSERT_TRUE(Move(20).ok());
  drive_->PowerCycle();
  EXPECT_EQ(ErrorReason(Move(30)), "NOT_HOMED");
  ASSERT_TRUE(Home().ok());
  EXPECT_TRUE(Move(30).ok());
}

TEST_F(DriveTest, WhatMovesIsStoppedWhenItIsOpened) {
  options_.kind = "generic";
  drive_ = *ModbusDrivePeer::Create(options_, bench_.world());
  ASSERT_TRUE(bench_.Serve(Wire::kTcp, {{1, drive_}}).ok());
  AxisMechanics mechanics;
  mechanics.max_acceleration_dps2 = 100;
  bench_.world()->SetMotion(AxisRole::kTurntable,
                            Travel(bench_.clock().Now(), 0, 1000, 1000, 20, mechanics));
  axis_ = OpenAxis();
  ASSERT_NE(axis_, nullptr);
  EXPECT_FALSE(World().moving);
}

TEST_F(DriveTest, APositionBeyondTheRegisterSaysToHome) {
  options_.steps_per_degree = 1e7;  // a turn and more than 2^31
  Start("generic", Wire::kTcp, "continuous = true\n");
  ASSERT_TRUE(Home().ok());
  ASSERT_TRUE(Move(170).ok());
  const absl::Status status = Move(340);
  EXPECT_EQ(status.code(), absl::StatusCode::kOutOfRange);
  EXPECT_EQ(ErrorReason(status), "AXIS_OVERFLOW");
  EXPECT_THAT(MessageOf(status), HasSubstr("home the axis"));
  EXPECT_NEAR(World().position.degrees(), 170, 0.01) << "it has not moved";
  EXPECT_TRUE(Move(150).ok());
}

TEST(SerialLine, IsSharedByAllThatIsOnIt) {
  ModbusBench bench;
  DrivePeerOptions options;
  auto turntable = *ModbusDrivePeer::Create(options, bench.world());
  options.role = AxisRole::kTilt;
  options.kind = "leadshine-rs";
  auto tilt = *ModbusDrivePeer::Create(options, bench.world());
  LampsPeerOptions lamps;
  lamps.lamps = 3;
  ASSERT_TRUE(bench
                  .Serve(Wire::kRtu, {{1, turntable},
                                      {2, tilt},
                                      {3, std::make_shared<ModbusLampsPeer>(lamps, bench.world())}})
                  .ok());
  const std::string motion =
      "steps_per_degree = 1000\nmax_velocity_dps = 100\nmax_acceleration_dps2 = 400\n"
      "response_timeout_ms = 500\nmin_deg = 0\nmax_deg = 90\n";
  auto first =
      bench.Open(ModbusAxisDriver(), "turntable", "unit = 1\nprofile = \"generic\"\n" + motion);
  auto second =
      bench.Open(ModbusAxisDriver(), "tilt", "unit = 2\nprofile = \"leadshine-rs\"\n" + motion);
  auto third = bench.Open(ModbusLampsDriver(), "lamps",
                          "unit = 3\nkind = \"coils\"\ncount = 3\nresponse_timeout_ms = 500\n");
  ASSERT_TRUE(first.ok()) << first.status();
  ASSERT_TRUE(second.ok()) << second.status();
  ASSERT_TRUE(third.ok()) << third.status();
  Pending<AxisState> a(bench.clock()), b(bench.clock());
  (*first)->Home(bench.In(seconds(30)), a.sink());
  (*second)->Home(bench.In(seconds(30)), b.sink());
  for (int i = 0; i < 20; ++i) {
    Pending<LampsState> lit(bench.clock());
    (*third)->Set({1, 0, static_cast<float>(i % 2)}, bench.In(seconds(30)), lit.sink());
    EXPECT_TRUE(lit.Wait(kNever, "Set").ok());
  }
  EXPECT_TRUE(a.Wait(kNever, "Home").ok());
  EXPECT_TRUE(b.Wait(kNever, "Home").ok());
  // One of them lost it, all of them have.
  bench.server().Unplug();
  Pending<LampsState> lost(bench.clock());
  (*third)->Set({1, 0, 1}, bench.In(seconds(30)), lost.sink());
  EXPECT_EQ(ErrorReason(lost.Wait(kNever, "Set").status()), "DEVICE_LOST");
  ASSERT_EQ(bench.server().Plug(), absl::OkStatus());
  Pending<LampsState> back(bench.clock());
  (*third)->Set({1, 0, 1}, bench.In(seconds(30)), back.sink());
  EXPECT_TRUE(back.Wait(kNever, "Set").ok());
  Pending<AxisState> moved(bench.clock());
  (*first)->Move(Degrees(5), 0, bench.In(seconds(30)), moved.sink());
  EXPECT_EQ(ErrorReason(moved.Wait(kNever, "Move").status()), "DEVICE_LOST");
  EXPECT_NE(ErrorReason(bench
                            .Open(ModbusLampsDriver(), "lamps",
                                  "unit = 3\nkind = \"coils\"\ncount = 3\nstop_bits = 2\n")
                            .status()),
            "OK");
}

}  // namespace
}  // namespace lightstage::sim
