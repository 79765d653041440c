#include "drivers/canopen/options.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/env.h"

namespace lightstage::canopen {
namespace {

using std::chrono::milliseconds;
using testing::HasSubstr;

template <class Options>
absl::Status Parse(const std::string& text, Options (*parse)(const TomlTable&), Options* options) {
  absl::StatusOr<TomlDocument> document =
      TomlDocument::Parse("[device]\n" + text, testing::TempDir() + "rig.toml");
  if (!document.ok()) return document.status();
  *options = parse(document->root().Table("device"));
  return document->Finish();
}

constexpr char kAxis[] =
    "interface = \"can0\"\nnode = 5\nunits_per_turn = 36000\nmax_velocity_dps = 20\n"
    "max_acceleration_dps2 = 40\nhoming_method = 19\nhoming_velocity_dps = 10\n";

absl::Status Axis(const std::string& text, AxisOptions* options) {
  return Parse(kAxis + text, &ParseAxisOptions, options);
}
absl::Status Lamps(const std::string& text, LampsOptions* options) {
  return Parse("interface = \"can0\"\nnode = 9\n" + text, &ParseLampsOptions, options);
}

TEST(CanopenOptions, EveryAxisKeyIsRead) {
  AxisOptions o;
  absl::Status status = Axis(
      "min_deg = -10\nmax_deg = 95\nvendor_id = 0x6A\nproduct_code = 7\nserial_number = 1234\n"
      "answer_ms = 50\nheartbeat_ms = 300\nheartbeat_id = 100\nzero_deg = 3\n"
      "velocity_units_per_turn_s = 600\nacceleration_units_per_turn_s2 = 60\nsettle_ms = 80\n"
      "tolerance_deg = 0.02\nstandstill_dps = 0.1\nhoming_slow_velocity_dps = 1\n"
      "stop = \"quick-stop\"\npdo = false\npoll_ms = 20\nenable_ms = 700\nsetpoint_ms = 90\n",
      &o);
  ASSERT_TRUE(status.ok()) << status;
  EXPECT_EQ(o.node.interface, "can0");
  EXPECT_EQ(o.node.node, 5);
  EXPECT_EQ(o.node.vendor, 0x6Au);
  EXPECT_EQ(o.node.product, 7u);
  EXPECT_EQ(o.node.serial, 1234u);
  EXPECT_EQ(o.node.answer_time, milliseconds(50));
  EXPECT_EQ(o.node.heartbeat, milliseconds(300));
  EXPECT_EQ(o.node.heartbeat_id, 100);
  EXPECT_EQ(o.min, Degrees(-10));
  EXPECT_EQ(o.max, Degrees(95));
  EXPECT_EQ(o.units_per_turn, 36000);
  EXPECT_EQ(o.zero, Degrees(3));
  EXPECT_EQ(o.velocity_units, 600);
  EXPECT_EQ(o.acceleration_units, 60);
  EXPECT_EQ(o.max_velocity_dps, 20);
  EXPECT_EQ(o.max_acceleration_dps2, 40);
  EXPECT_EQ(o.settle, milliseconds(80));
  EXPECT_EQ(o.tolerance, Degrees(0.02));
  EXPECT_EQ(o.standstill_dps, 0.1);
  EXPECT_EQ(o.homing_method, 19);
  EXPECT_EQ(o.homing_velocity_dps, 10);
  EXPECT_EQ(o.homing_slow_velocity_dps, 1);
  EXPECT_TRUE(o.stop_by_quick_stop);
  EXPECT_FALSE(o.use_pdo);
  EXPECT_EQ(o.poll, milliseconds(20));
  EXPECT_EQ(o.enable_time, milliseconds(700));
  EXPECT_EQ(o.setpoint_time, milliseconds(90));
}

TEST(CanopenOptions, DefaultsFollowTheUnits) {
  AxisOptions o;
  ASSERT_TRUE(Axis("continuous = true\n", &o).ok());
  EXPECT_TRUE(o.continuous);
  EXPECT_EQ(o.velocity_units, 36000);
  EXPECT_EQ(o.acceleration_units, 36000);
  EXPECT_EQ(o.homing_slow_velocity_dps, 2);
  EXPECT_EQ(o.node.heartbeat, milliseconds(500));
  EXPECT_FALSE(o.stop_by_quick_stop);
  LampsOptions lamps;
  ASSERT_TRUE(Lamps("output = \"digital\"\n", &lamps).ok());
  EXPECT_EQ(lamps.full_scale, 1);
  EXPECT_NE(lamps.node.heartbeat_id, o.node.heartbeat_id)
      << "what keeps the axes alive must not keep the lamps lit";
}

TEST(CanopenOptions, LampsKeysAreRead) {
  LampsOptions o;
  ASSERT_TRUE(
      Lamps("output = \"analogue\"\nfirst_output = 4\nfull_scale = 30000\nsettle_ms = 5\n", &o)
          .ok());
  EXPECT_EQ(o.output, LampOutput::kAnalogue);
  EXPECT_EQ(o.first_output, 4);
  EXPECT_EQ(o.full_scale, 30000);
  EXPECT_EQ(o.settle, milliseconds(5));
}

TEST(CanopenOptions, MistakesAreRefusedAtTheirKey) {
  AxisOptions axis;
  const struct {
    const char *text, *key;
  } mistakes[] = {
      {"continuous = true\nmin_deg = 0", "min_deg"},
      {"min_deg = 90\nmax_deg = 0", "min_deg"},
      {"min_deg = 0", "max_deg"},
      {"continuous = true\nheartbeat_id = 5", "heartbeat_id"},
      {"continuous = true\nheartbeat_ms = 10", "heartbeat_ms"},
      {"continuous = true\nanswer_ms = 2000", "answer_ms"},
      {"continuous = true\nstop = \"brake\"", "stop"},
      {"continuous = true\nzero_deg = nan", "zero_deg"},
      {"continuous = true\nvendor_id = -1", "vendor_id"},
      {"continuous = true\nnod = 5", "nod"},
      {"continuous = true\neds = \"there-is-no.eds\"", "eds"},
  };
  for (const auto& mistake : mistakes) {
    const absl::Status status = Axis(mistake.text, &axis);
    EXPECT_FALSE(status.ok()) << mistake.text;
    EXPECT_THAT(std::string(status.message()), HasSubstr(mistake.key)) << mistake.text;
  }
  LampsOptions lamps;
  for (const char* text :
       {"interface = \"can/0\"", "interface = \"\"", "interface = \"a-name-too-long-0\""}) {
    EXPECT_THAT(std::string(Parse(std::string(text) + "\nnode = 9\noutput = \"digital\"\n",
                                  &ParseLampsOptions, &lamps)
                                .message()),
                HasSubstr("interface"))
        << text;
  }
  for (const char* bad :
       {"", "output = \"relay\"", "output = \"digital\"\nfull_scale = 100",
        "output = \"analogue\"\nfull_scale = 32768", "output = \"digital\"\nfirst_output = -1"}) {
    EXPECT_FALSE(Lamps(bad, &lamps).ok()) << bad;
  }
}

TEST(CanopenOptions, DataSheetIsReadBesideTheRigFile) {
  ASSERT_TRUE(PosixEnv()
                  .WriteFile(testing::TempDir() + "drive.eds",
                             "[DeviceInfo]\n[1000]\nDataType=7\nAccessType=ro\n")
                  .ok());
  AxisOptions o;
  ASSERT_TRUE(Axis("continuous = true\neds = \"drive.eds\"\n", &o).ok());
  ASSERT_NE(o.node.eds, nullptr);
  EXPECT_NE(o.node.eds->Find({0x1000, 0}), nullptr);
  ASSERT_TRUE(PosixEnv().WriteFile(testing::TempDir() + "bad.eds", "[DeviceInfo]\nwhat\n").ok());
  EXPECT_THAT(std::string(Axis("continuous = true\neds = \"bad.eds\"\n", &o).message()),
              HasSubstr("bad.eds:2"));
}

}  // namespace
}  // namespace lightstage::canopen
