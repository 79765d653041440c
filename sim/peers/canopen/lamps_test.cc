// The lamps of the canopen driver over a simulated output module: what really shines, and what happens when something fails.
#include <gmock/gmock.h>

#include "drivers/canopen/discovery.h"
#include "drivers/conformance/unplug.h"
#include "sim/peers/canopen/test_bench.h"

namespace lightstage::sim {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::HasSubstr;

const std::vector<float> kDark = {0, 0, 0}, kLit = {1, 1, 1}, kOne = {0, 1, 0};

class CanopenLampsTest : public testing::Test {
 protected:
  void Open(const OutputModuleOptions& module = {}, const std::string& more = "",
            const std::string& common = kPatient) {
    bench_.AddOutputs(module);
    absl::StatusOr<std::unique_ptr<Lamps>> lamps = bench_.OpenLamps(
        common + (module.analogue ? "node = 9\noutput = \"analogue\"\n" : kDigitalLamps) + more);
    ASSERT_TRUE(lamps.ok()) << lamps.status();
    lamps_ = *std::move(lamps);
  }
  absl::StatusOr<LampsState> Set(const std::vector<float>& levels) {
    Pending<LampsState> done(bench_.clock());
    lamps_->Set(levels, bench_.Soon(), done.sink());
    return done.Wait(kNever, "Set");
  }

  TestBench bench_;
  std::unique_ptr<Lamps> lamps_;
};

TEST_F(CanopenLampsTest, TheModuleIsToldToGoDarkOnFailure) {
  Open({.first_output = 6}, "first_output = 6\n");
  for (uint8_t group : {1, 2}) {
    EXPECT_EQ(bench_.outputs().node().Value(0x6206, group), 0xFFu);
    EXPECT_EQ(bench_.outputs().node().Value(0x6207, group), 0u);
  }
  EXPECT_EQ(bench_.outputs().node().Value(0x1029, 1), 0u);
  ASSERT_TRUE(Set(kLit).ok());
  EXPECT_EQ(bench_.outputs().node().Value(0x6200, 1), 0xC0u) << "lamps 0 and 1: outputs 6 and 7";
  EXPECT_EQ(bench_.outputs().node().Value(0x6200, 2), 0x01u) << "lamp 2: output 8";
  ASSERT_TRUE(lamps_->SetTimeToDark(milliseconds(700)).ok());
  EXPECT_EQ(bench_.outputs().node().Value(0x1016, 1), 0x007E02BCu) << "node 126, 700 ms";
}

TEST_F(CanopenLampsTest, UnpluggedIsToldWithinASecondAndKeepsNothingOpen) {
  Open({}, "", "interface = \"can0\"\n");
  bool on = false;
  const auto set = [&] { return Set((on = !on) ? kLit : kOne).status(); };
  CheckUnplugging(bench_.clock(), "lamps",
                  {.plug = [&](bool plugged) { bench_.outputs().node().SetSilent(!plugged); },
                   .use = set,
                   .recover = set});
}

TEST_F(CanopenLampsTest, AnalogueLevelsAreReported) {
  Open({.analogue = true, .outputs = 3}, "full_scale = 10000\n");
  EXPECT_EQ(lamps_->info().steps, 10000);
  const absl::StatusOr<LampsState> state = Set({0.25f, 0, 0.12345f});
  ASSERT_TRUE(state.ok()) << state.status();
  EXPECT_EQ(bench_.outputs().node().Value(0x6411, 1), 2500u);
  EXPECT_FLOAT_EQ(state->levels[2], 0.1235f) << "quantised";
  EXPECT_EQ(bench_.outputs().node().Value(0x6443, 3), 1u);
  EXPECT_EQ(bench_.outputs().node().Value(0x6444, 3), 0u);
}

// The daemon is gone, whichever way: nothing refreshes, nothing is said.
TEST_F(CanopenLampsTest, GoDarkWithoutTheDaemonBesideAnAxisThatLives) {
  bench_.AddDrive();
  absl::StatusOr<std::unique_ptr<Axis>> axis = bench_.OpenAxis(std::string(kPatient) + kTurntable);
  ASSERT_TRUE(axis.ok()) << axis.status();
  Open();
  ASSERT_TRUE(lamps_->SetTimeToDark(milliseconds(1500)).ok());
  ASSERT_TRUE(Set(kLit).ok());
  EXPECT_EQ(bench_.Light(), kLit);
  // The axis' heartbeat goes on on the same wire.
  ASSERT_TRUE(bench_.Becomes([&] { return bench_.Light() == kDark; }));
  // What was lit is not so any more, and Refresh says so.
  ASSERT_TRUE(bench_.Becomes([&] { return ErrorReason(lamps_->Refresh()) == "LAMPS_DARK"; }));
  EXPECT_EQ(bench_.outputs().node().Value(0x6200, 1), 0x07u) << "the object alone would not tell";
  ASSERT_TRUE(Set(kOne).ok());
  EXPECT_EQ(bench_.Light(), kOne);
}

TEST_F(CanopenLampsTest, NoTimeToDarkWhereTheModuleCanNot) {
  Open({.has_error_mode = false});
  EXPECT_EQ(lamps_->info().max_time_to_dark, Duration::zero());
  EXPECT_EQ(ErrorReason(lamps_->SetTimeToDark(seconds(1))), "TIME_TO_DARK");
}

TEST_F(CanopenLampsTest, WhatReadsBackOtherwiseIsNotConfirmed) {
  Open();
  bench_.outputs().IgnoreWrites(true);
  const absl::Status failed = Set(kLit).status();
  EXPECT_EQ(ErrorReason(failed), "LAMP_NOT_CONFIRMED") << failed;
  EXPECT_THAT(failed.message(), HasSubstr("6200h:01"));
}

TEST_F(CanopenLampsTest, RebootIsNoticedAndTheNextSetConnectsAnew) {
  Open();
  ASSERT_TRUE(lamps_->SetTimeToDark(seconds(5)).ok());
  ASSERT_TRUE(Set(kLit).ok());
  bench_.outputs().node().Reboot();
  EXPECT_TRUE(bench_.Becomes([&] { return ErrorReason(lamps_->Refresh()) == "DEVICE_LOST"; }));
  ASSERT_TRUE(Set(kOne).ok());
  EXPECT_EQ(bench_.Light(), kOne);
  EXPECT_EQ(bench_.outputs().node().Value(0x1016, 1), 0x007E1388u) << "set again: 5000 ms";
}

TEST_F(CanopenLampsTest, SilentModuleIsLostAndComesBack) {
  Open({}, "", "interface = \"can0\"\nanswer_ms = 1000\nheartbeat_ms = 1500\n");
  ASSERT_TRUE(Set(kLit).ok());
  bench_.outputs().node().SetSilent(true);
  ASSERT_TRUE(bench_.Becomes([&] { return ErrorReason(Set(kOne).status()) == "DEVICE_LOST"; }));
  bench_.outputs().node().SetSilent(false);
  ASSERT_TRUE(bench_.Becomes([&] { return Set(kOne).ok(); }));
  EXPECT_EQ(bench_.Light(), kOne);
}

TEST_F(CanopenLampsTest, BusOffIsLostAndComesBack) {
  Open();
  ASSERT_TRUE(Set(kLit).ok());
  bench_.wire().SetState(bench_.master(), canopen::CanState::kBusOff);
  ASSERT_TRUE(bench_.Becomes([&] { return ErrorReason(Set(kOne).status()) == "DEVICE_LOST"; }));
  bench_.wire().SetState(bench_.master(), canopen::CanState::kActive);
  ASSERT_TRUE(bench_.Becomes([&] { return Set(kOne).ok(); }));
  EXPECT_EQ(bench_.Light(), kOne);
}

TEST_F(CanopenLampsTest, UnsuitableModulesAreNamed) {
  bench_.AddOutputs({.outputs = 8});
  absl::Status few =
      bench_.OpenLamps(std::string(kPatient) + kDigitalLamps + "first_output = 6\n").status();
  EXPECT_EQ(ErrorReason(few), "DEVICE_UNSUITABLE") << few;
  EXPECT_THAT(few.message(), HasSubstr("has 8 digital outputs"));
  few = bench_.OpenLamps(std::string(kPatient) + "node = 9\noutput = \"analogue\"\n").status();
  EXPECT_THAT(few.message(), HasSubstr("has 0 analogue outputs"));
  bench_.AddDrive();
  const absl::Status wrong =
      bench_.OpenLamps(std::string(kPatient) + "node = 5\noutput = \"digital\"\n").status();
  EXPECT_EQ(ErrorReason(wrong), "DEVICE_UNSUITABLE") << wrong;
  EXPECT_THAT(wrong.message(), HasSubstr("must be a CiA 401 I/O module"));
}

// A heartbeat that an axis says all the time must not be the one that keeps the lamps lit.
TEST_F(CanopenLampsTest, HeartbeatIdOfTheAxesIsRefused) {
  bench_.AddDrive();
  absl::StatusOr<std::unique_ptr<Axis>> axis = bench_.OpenAxis(std::string(kPatient) + kTurntable);
  ASSERT_TRUE(axis.ok()) << axis.status();
  bench_.AddOutputs();
  const absl::Status refused =
      bench_.OpenLamps(std::string(kPatient) + kDigitalLamps + "heartbeat_id = 127\n").status();
  EXPECT_EQ(ErrorReason(refused), "NODE_TAKEN") << refused;
}

TEST_F(CanopenLampsTest, DarkerComesBeforeBrighter) {
  Open();
  ASSERT_TRUE(Set({1, 0, 0}).ok());
  const size_t before = bench_.wire().Sent().size();
  ASSERT_TRUE(Set({0, 0, 1}).ok());
  std::vector<uint8_t> written;
  const std::vector<canopen::CanFrame> sent = bench_.wire().Sent();
  for (size_t i = before; i < sent.size(); ++i) {
    if (sent[i].id == 0x609 && sent[i].data[0] == 0x2F && sent[i].data[2] == 0x62) {
      written.push_back(sent[i].data[4]);
    }
  }
  EXPECT_THAT(written, testing::ElementsAre(0, 4));
}

TEST_F(CanopenLampsTest, DiscoveryFindsWhatAnswers) {
  bench_.AddDrive();
  OutputModuleOptions silent_serial;
  silent_serial.identity.serial = 0;
  silent_serial.identity.name = "a name of more than four bytes";
  bench_.AddOutputs(silent_serial);
  std::unique_ptr<canopen::CanPort> port = bench_.wire().Attach();
  absl::StatusOr<std::vector<canopen::FoundNode>> found =
      canopen::ScanNodes(*port, bench_.clock(), seconds(1));
  ASSERT_TRUE(found.ok()) << found.status();
  ASSERT_EQ(found->size(), 2u);
  EXPECT_EQ((*found)[0].node, 5);
  EXPECT_EQ((*found)[0].identity.serial, 4711u);
  EXPECT_EQ((*found)[1].node, 9);
  EXPECT_EQ((*found)[1].identity.name, "a name of more than four bytes");

  const Discovered axis = canopen::DescribeNode("can0", (*found)[0]);
  EXPECT_THAT(axis.what, HasSubstr("node 5 on can0: a CiA 402 drive"));
  EXPECT_THAT(axis.toml, HasSubstr("serial_number = 4711"));
  // What is to be pasted is a rig file's table as it stands.
  const Discovered lamps = canopen::DescribeNode("can0", (*found)[1]);
  absl::StatusOr<TomlDocument> document = TomlDocument::Parse(lamps.toml, "rig.toml");
  ASSERT_TRUE(document.ok()) << lamps.toml;
  TomlTable table = document->root().Table("lamps");
  EXPECT_EQ(table.String("driver"), "canopen");
  const canopen::LampsOptions options = canopen::ParseLampsOptions(table);
  EXPECT_TRUE(document->Finish().ok()) << document->Finish();
  EXPECT_EQ(options.node.node, 9);
  EXPECT_EQ(options.node.interface, "can0");
}

}  // namespace
}  // namespace lightstage::sim
