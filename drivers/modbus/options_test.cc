#include "drivers/modbus/options.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/status.h"
#include "drivers/modbus/driver.h"

namespace lightstage {
namespace {

using std::chrono::milliseconds;
using testing::ElementsAre;
using testing::HasSubstr;

constexpr char kAxis[] =
    "driver = \"modbus\"\nhost = \"192.168.7.5\"\nunit = 3\nprofile = \"leadshine-rs\"\n"
    "steps_per_degree = 1000\nmin_deg = 0\nmax_deg = 90\nmax_velocity_dps = 20\n"
    "max_acceleration_dps2 = 40\n";

absl::Status Axis(const std::string& text, ModbusAxisOptions* options) {
  absl::StatusOr<TomlDocument> document = TomlDocument::Parse("[tilt]\n" + text, "rig.toml");
  if (!document.ok()) return document.status();
  document->root().Table("tilt").String("driver", "");
  *options = ParseModbusAxisOptions(document->root().Table("tilt"));
  return document->Finish();
}

// kAxis with `from` replaced by `to`; its error, or "".
std::string AxisError(const std::string& from, const std::string& to) {
  std::string text = kAxis;
  text.replace(text.find(from), from.size(), to);
  ModbusAxisOptions options;
  return MessageOf(Axis(text, &options));
}

absl::Status Lamps(const std::string& text, ModbusLampsOptions* options) {
  absl::StatusOr<TomlDocument> document = TomlDocument::Parse("[lamps]\n" + text, "rig.toml");
  if (!document.ok()) return document.status();
  *options = ParseModbusLampsOptions(document->root().Table("lamps"));
  return document->Finish();
}

std::string LampsError(const std::string& text) {
  ModbusLampsOptions options;
  return MessageOf(Lamps(text, &options));
}

TEST(ModbusAxisOptions, DefaultsOverTcp) {
  ModbusAxisOptions o;
  ASSERT_TRUE(Axis(kAxis, &o).ok()) << Axis(kAxis, &o);
  EXPECT_TRUE(o.line.tcp());
  EXPECT_EQ(o.line.Name(), "192.168.7.5:502");
  EXPECT_EQ(o.line.response_timeout, milliseconds(200));
  EXPECT_EQ(o.line.retries, 2);
  EXPECT_EQ(o.unit, 3);
  EXPECT_EQ(o.profile.name, "leadshine-rs");
  EXPECT_EQ(o.steps_per_rev, 10000) << "as the drive is delivered";
  EXPECT_EQ(o.max, Degrees(90));
  EXPECT_FALSE(o.continuous);
  EXPECT_EQ(o.plausibility_move, Degrees(0.5));
  EXPECT_EQ(o.tolerance, Degrees(0.05));
}

TEST(ModbusAxisOptions, EveryKeyIsRead) {
  ModbusAxisOptions o;
  const absl::Status status = Axis(
      "serial_port = \"/dev/serial/by-id/usb-1\"\nbaud = 38400\nparity = \"even\"\nstop_bits = 2\n"
      "frame_gap_ms = 10\nresponse_timeout_ms = 80\nretries = 5\nunit = 7\n"
      "profile = \"applied-motion\"\nsteps_per_rev = 4000\nsteps_per_degree = 500\nreverse = true\n"
      "zero_deg = -3\ncontinuous = true\nmax_velocity_dps = 30\nmax_acceleration_dps2 = 60\n"
      "settle_ms = 150\ntolerance_deg = 0.02\nplausibility_move_deg = 0.3\npoll_ms = 40\n",
      &o);
  ASSERT_TRUE(status.ok()) << status;
  EXPECT_EQ(o.line.Name(), "/dev/serial/by-id/usb-1");
  EXPECT_EQ(o.line.baud, 38400);
  EXPECT_EQ(o.line.parity, 'E');
  EXPECT_EQ(o.line.stop_bits, 2);
  EXPECT_EQ(o.line.frame_gap, milliseconds(10));
  EXPECT_EQ(o.line.response_timeout, milliseconds(80));
  EXPECT_EQ(o.line.retries, 5);
  EXPECT_EQ(o.unit, 7);
  EXPECT_EQ(o.steps_per_rev, 4000);
  EXPECT_TRUE(o.reverse);
  EXPECT_EQ(o.zero, Degrees(-3));
  EXPECT_TRUE(o.continuous);
  EXPECT_EQ(o.settle, milliseconds(150));
  EXPECT_EQ(o.plausibility_move, Degrees(0.3));
  EXPECT_EQ(o.poll, milliseconds(40));
}

TEST(ModbusAxisOptions, BadValuesAreRefusedAtTheirKey) {
  EXPECT_THAT(AxisError("host = \"192.168.7.5\"\n", ""), HasSubstr("serial_port"));
  EXPECT_THAT(AxisError("unit = 3", "serial_port = \"/dev/ttyUSB0\""), HasSubstr("one of host"));
  EXPECT_THAT(AxisError("host = \"192.168.7.5\"",
                        "serial_port = \"/dev/x\"\nbaud = 9601\n"
                        "parity = \"none\""),
              HasSubstr("rig.toml:4"));
  EXPECT_THAT(AxisError("host = \"192.168.7.5\"", "serial_port = \"/dev/x\"\nbaud = 9600"),
              HasSubstr("parity"));
  EXPECT_THAT(AxisError("unit = 3", "unit = 248"), HasSubstr("rig.toml:4"));
  EXPECT_THAT(AxisError("host = \"192.168.7.5\"\nunit = 3",
                        "serial_port = \"/dev/x\"\nbaud = 9600\nparity = \"none\"\nunit = 0"),
              HasSubstr("from 1 to 247"));
  EXPECT_THAT(AxisError("leadshine-rs", "leadshine"), HasSubstr("rig.toml:5"));
  EXPECT_THAT(AxisError("max_deg = 90", "max_deg = 0"), HasSubstr("below max_deg"));
  EXPECT_THAT(AxisError("steps_per_degree = 1000", "steps_per_degree = 1000\nretires = 1"),
              HasSubstr("retries"));
  EXPECT_THAT(AxisError("steps_per_degree = 1000", "steps_per_degree = 10"),
              HasSubstr("tolerance_deg"));
  EXPECT_THAT(AxisError("unit = 3", "plausibility_move_deg = 0.1"), HasSubstr("4 times"));
  // 1 rpm is 166.7 steps/s; what is slower cannot be told.
  EXPECT_THAT(AxisError("max_velocity_dps = 20", "max_velocity_dps = 0.1"),
              HasSubstr("max_velocity_dps"));
  EXPECT_THAT(AxisError("max_acceleration_dps2 = 40", "max_acceleration_dps2 = 0.001"),
              HasSubstr("max_acceleration_dps2"));
  EXPECT_THAT(AxisError("steps_per_degree = 1000\nmin_deg = 0\nmax_deg = 90",
                        "steps_per_degree = 1e6\nmin_deg = 0\nmax_deg = 3000"),
              HasSubstr("max_deg"));
}

TEST(ModbusAxisOptions, TheDriverReadsItsTable) {
  auto document = TomlDocument::Parse("[turntable]\nhost = \"::1\"\n", "rig.toml");
  ASSERT_TRUE(document.ok());
  ModbusAxisDriver().parse(document->root().Table("turntable"));
  EXPECT_THAT(MessageOf(document->Finish()), HasSubstr("profile: missing"));
}

TEST(ModbusLampsOptions, FortyRelays) {
  ModbusLampsOptions o;
  const absl::Status status =
      Lamps("host = \"10.0.0.7\"\nkind = \"coils\"\nfirst = 16\ncount = 40\n", &o);
  ASSERT_TRUE(status.ok()) << status;
  EXPECT_EQ(o.lamps(), 40);
  ASSERT_EQ(o.boards.size(), 1u);
  EXPECT_EQ(o.boards[0].unit, 1);
  EXPECT_EQ(o.boards[0].addresses[39], 55);
  EXPECT_EQ(o.full, 1);
  EXPECT_FALSE(o.inverted);
  EXPECT_FALSE(o.watchdog.has_value());
}

TEST(ModbusLampsOptions, SeveralBoardsWithAWatchdog) {
  ModbusLampsOptions o;
  const absl::Status status = Lamps(
      "serial_port = \"/dev/ttyUSB0\"\nbaud = 9600\nparity = \"none\"\nkind = \"registers\"\n"
      "full = 255\nsingle_writes = true\nsettle_ms = 5\nconfirm_ms = 0\n"
      "[[lamps.board]]\nunit = 1\naddresses = [4, 2, 3]\n"
      "[[lamps.board]]\nunit = 2\ncount = 2\n"
      "[lamps.watchdog]\nregister = 100\nstep_ms = 100\nmax = 600\n",
      &o);
  ASSERT_TRUE(status.ok()) << status;
  EXPECT_EQ(o.lamps(), 5);
  EXPECT_THAT(o.boards[0].addresses, ElementsAre(4, 2, 3));
  EXPECT_THAT(o.boards[1].addresses, ElementsAre(0, 1));
  EXPECT_EQ(o.boards[1].unit, 2);
  EXPECT_EQ(o.full, 255);
  EXPECT_TRUE(o.single_writes);
  ASSERT_TRUE(o.watchdog.has_value());
  EXPECT_EQ(o.watchdog->step * o.watchdog->max, std::chrono::minutes(1));
}

TEST(ModbusLampsOptions, BadValuesAreRefusedAtTheirKey) {
  const std::string good = "host = \"a\"\nkind = \"coils\"\n";
  EXPECT_THAT(LampsError(good), HasSubstr("count"));
  EXPECT_THAT(LampsError(good + "count = 2\naddresses = [1]\n"), HasSubstr("in place of"));
  EXPECT_THAT(LampsError(good + "addresses = [1, 2, 1]\n"), HasSubstr("address 1 of unit 1"));
  EXPECT_THAT(LampsError(good + "addresses = [1.5]\n"), HasSubstr("whole"));
  EXPECT_THAT(LampsError(good + "addresses = []\n"), HasSubstr("no lamp"));
  EXPECT_THAT(LampsError(good + "first = 65530\ncount = 10\n"), HasSubstr("65535"));
  EXPECT_THAT(LampsError(good + "count = 4\nfull = 255\n"), HasSubstr("full"));
  EXPECT_THAT(LampsError("host = \"a\"\nkind = \"registers\"\ncount = 4\n"), HasSubstr("full"));
  EXPECT_THAT(
      LampsError("host = \"a\"\nkind = \"registers\"\nfull = 9\ninverted = true\ncount = 4\n"),
      HasSubstr("inverted"));
  EXPECT_THAT(LampsError(good + "count = 4\n[lamps.watchdog]\nregister = 3\n"),
              HasSubstr("step_ms"));
}

}  // namespace
}  // namespace lightstage
