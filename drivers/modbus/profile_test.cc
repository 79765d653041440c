#include "drivers/modbus/profile.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "base/status.h"

namespace lightstage {
namespace {

using testing::ElementsAre;
using testing::ElementsAreArray;
using testing::HasSubstr;
using testing::Optional;

// The registers of a published write (function 16), whose bytes with unit and CRC are `frame`.
std::vector<uint16_t> Registers(std::initializer_list<int> frame) {
  const std::vector<int> bytes(frame);
  uint16_t crc = 0xFFFF;  // MODBUS over Serial Line V1.02, 6.2.2
  for (size_t i = 0; i + 2 < bytes.size(); ++i) {
    crc ^= static_cast<uint16_t>(bytes[i]);
    for (int bit = 0; bit < 8; ++bit) {
      crc = static_cast<uint16_t>(crc & 1 ? crc >> 1 ^ 0xA001 : crc >> 1);
    }
  }
  EXPECT_EQ(crc, bytes[bytes.size() - 2] | bytes[bytes.size() - 1] << 8) << "not as published";
  EXPECT_EQ(bytes[1], 0x10);
  std::vector<uint16_t> words;
  for (size_t i = 7; i + 3 < bytes.size(); i += 2) {
    words.push_back(static_cast<uint16_t>(bytes[i] << 8 | bytes[i + 1]));
  }
  return words;
}

DriveProfile Shipped(const std::string& name) {
  absl::StatusOr<DriveProfile> profile = LoadDriveProfile(name, "");
  EXPECT_TRUE(profile.ok()) << profile.status();
  return profile.ok() ? *profile : DriveProfile{};
}

TEST(ShippedProfiles, AreAllSound) {
  EXPECT_GE(ShippedProfiles().size(), 5u);
  for (const ShippedProfile& shipped : ShippedProfiles()) {
    absl::StatusOr<DriveProfile> profile =
        ParseDriveProfile(shipped.text, std::string(shipped.name));
    EXPECT_TRUE(profile.ok()) << profile.status();
  }
}

TEST(ShippedProfiles, OrientalMotorMovesAsItsManualSays) {
  // HM-60262E, example of direct data operation: incremental (type 2), position 8500, speed 2000 Hz, rates 1.5 kHz/s, current 100 %,
  // trigger 1.
  std::vector<uint16_t> published =
      Registers({0x01, 0x10, 0x00, 0x58, 0x00, 0x10, 0x20, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00,
                 0x02, 0x00, 0x00, 0x21, 0x34, 0x00, 0x00, 0x07, 0xD0, 0x00, 0x00, 0x05, 0xDC, 0x00,
                 0x00, 0x05, 0xDC, 0x00, 0x00, 0x03, 0xE8, 0x00, 0x00, 0x00, 0x01, 0x1C, 0x08});
  published[3] = 1;  // ours is absolute
  const DriveProfile profile = Shipped("oriental-motor-az");
  ASSERT_EQ(profile.move.size(), 1u);
  EXPECT_EQ(profile.move[0].address, 0x0058);
  EXPECT_FALSE(profile.move[0].single);
  EXPECT_EQ(VelocityValue(profile, 2000, 0), 2000);
  EXPECT_EQ(AccelerationValue(profile, 1500, 0), 1500);
  EXPECT_THAT(EncodeStep(profile, profile.move[0], {8500, 2000, 1500}),
              Optional(ElementsAreArray(published)));
}

TEST(ShippedProfiles, LeadshineMovesAsItsManualSays) {
  // CS2RS user manual, p. 43: PR0, absolute, 10000 pulses. (Its text says 200 rpm, its bytes 0.)
  const std::vector<uint16_t> published =
      Registers({0x07, 0x10, 0x62, 0x00, 0x00, 0x08, 0x10, 0x00, 0x01, 0x00, 0x00, 0x27, 0x10,
                 0x00, 0x00, 0x27, 0x10, 0x27, 0x10, 0x00, 0x00, 0x00, 0x10, 0x8D, 0x50});
  const DriveProfile profile = Shipped("leadshine-rs");
  ASSERT_EQ(profile.move.size(), 1u);
  EXPECT_EQ(profile.move[0].address, 0x6200);
  EXPECT_THAT(EncodeStep(profile, profile.move[0], {10000, 0, 10000}),
              Optional(ElementsAreArray(published)));
  // 200 rpm of 10000 steps a revolution; from 0 to 1000 rpm within 10 s.
  EXPECT_EQ(VelocityValue(profile, 200.0 / 60 * 10000, 10000), 200);
  EXPECT_EQ(AccelerationValue(profile, 100.0 / 60 * 10000, 10000), 10000);
}

TEST(ShippedProfiles, AppliedMotionCountsItsRegistersFrom40001) {
  const DriveProfile profile = Shipped("applied-motion");
  // MOONS' M2 user manual, p. 155: the encoder position, register 40005, is read by 01 03 00 04 00 02.
  EXPECT_EQ(profile.position.address, 0x0004);
  EXPECT_EQ(profile.position.format.words, 2);
  ASSERT_EQ(profile.move.size(), 2u);
  EXPECT_EQ(profile.move[0].address, 40028 - 40001);
  EXPECT_EQ(profile.move[1].address, 40125 - 40001);
  EXPECT_TRUE(profile.move[1].single);
  // 10 rps is 2400, 100 rps² are 600.
  EXPECT_EQ(VelocityValue(profile, 10 * 20000, 20000), 2400);
  EXPECT_EQ(AccelerationValue(profile, 100 * 20000, 20000), 600);
  EXPECT_THAT(EncodeStep(profile, profile.move[0], {-2, 2400, 600}),
              Optional(ElementsAre(600, 600, 2400, 0xFFFF, 0xFFFE)));
}

TEST(ShippedProfiles, DifferInWordOrder) {
  const DriveProfile high = Shipped("generic"), low = Shipped("generic-low-word-first");
  EXPECT_THAT(EncodeStep(high, high.move[0], {0x10002, 3, 4}),
              Optional(ElementsAre(1, 2, 0, 3, 0, 4, 1)));
  EXPECT_THAT(EncodeStep(low, low.move[0], {0x10002, 3, 4}),
              Optional(ElementsAre(2, 1, 3, 0, 4, 0, 1)));
}

TEST(DriveProfile, RatesAreRoundedToTheSafeSide) {
  DriveProfile profile = Shipped("leadshine-rs");
  EXPECT_EQ(VelocityValue(profile, 200.9 / 60 * 10000, 10000), 200);
  EXPECT_EQ(VelocityValue(profile, 0.9 / 60 * 10000, 10000), std::nullopt) << "slower than it can";
  EXPECT_EQ(VelocityValue(profile, 5001.0 / 60 * 10000, 10000), std::nullopt);
  EXPECT_EQ(AccelerationValue(profile, 999.0 / 60 * 10000, 10000), 1002) << "longer is gentler";
  EXPECT_EQ(AccelerationValue(profile, 0, 10000), std::nullopt);
  EXPECT_EQ(AccelerationValue(profile, std::nan(""), 10000), std::nullopt);
}

TEST(DriveProfile, ValuesOutOfTheirRangeAreNotWritten) {
  const DriveProfile profile = Shipped("leadshine-rs");
  EXPECT_FALSE(EncodeStep(profile, profile.move[0], {int64_t{1} << 31, 1, 1}).has_value());
  EXPECT_FALSE(EncodeStep(profile, profile.move[0], {0, 65536, 1}).has_value());
}

// ---- The parser

constexpr char kSmall[] = R"(model = "small"
order = "high_first"
[position]
register = 0x10
words = 1
[status]
register = 0x11
moving = 1
fault = 8
[velocity]
unit = "steps_per_s"
[acceleration]
unit = "steps_per_s2"
[[move]]
register = 0x20
values = "position velocity"
[[home]]
register = 0x30
values = "1"
[[halt]]
register = 0x30
values = "2"
)";

// kSmall with `from` replaced by `to`; its error, or "".
std::string ErrorOf(const std::string& from, const std::string& to) {
  std::string text = kSmall;
  const size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  text.replace(at, from.size(), to);
  absl::StatusOr<DriveProfile> profile = ParseDriveProfile(text, "small.toml");
  if (profile.ok()) return "";
  EXPECT_TRUE(absl::IsInvalidArgument(profile.status()));
  return MessageOf(profile.status());
}

TEST(DriveProfileParser, TakesTheLeastThereCanBe) {
  absl::StatusOr<DriveProfile> profile = ParseDriveProfile(kSmall, "small.toml");
  ASSERT_TRUE(profile.ok()) << profile.status();
  EXPECT_EQ(profile->position.address, 0x10);
  EXPECT_EQ(profile->position.format.words, 1);
  EXPECT_EQ(profile->target.words, 2);
  EXPECT_EQ(profile->status.homed, 0u);
  EXPECT_FALSE(profile->fault_code.has_value());
  EXPECT_TRUE(profile->home[0].single);
  EXPECT_FALSE(profile->move[0].single);
}

TEST(DriveProfileParser, NamesThePlaceOfEveryFault) {
  EXPECT_THAT(ErrorOf("register = 0x11", "register = 0x11\nmovign = 1"),
              HasSubstr("small.toml:8:1"));
  EXPECT_THAT(ErrorOf("order = \"high_first\"", "order = \"big\""), HasSubstr("small.toml:2:1"));
  EXPECT_THAT(ErrorOf("order = \"high_first\"\n", ""), HasSubstr("order"));
  EXPECT_THAT(ErrorOf("moving = 1", "moving = 1\nstanding = 2"), HasSubstr("standing"));
  EXPECT_THAT(ErrorOf("moving = 1\n", ""), HasSubstr("small.toml:6:1"));
  EXPECT_THAT(ErrorOf("moving = 1", "moving = 0x10000"), HasSubstr("65535"));
  EXPECT_THAT(ErrorOf("fault = 8\n", ""), HasSubstr("fault"));
  EXPECT_THAT(ErrorOf("words = 1", "words = 3"), HasSubstr("small.toml:5:1"));
  EXPECT_THAT(ErrorOf("register = 0x10\nwords = 1", "register = 0xFFFF\nwords = 2"),
              HasSubstr("65534"));
  EXPECT_THAT(ErrorOf("unit = \"steps_per_s\"", "unit = \"furlongs\""), HasSubstr("rev_per_s"));
  EXPECT_THAT(ErrorOf("unit = \"steps_per_s\"", "unit = \"rpm\"\nmin = 9\nmax = 8"),
              HasSubstr("above max"));
  EXPECT_THAT(ErrorOf("unit = \"steps_per_s2\"", "unit = \"ms_to_rpm\""), HasSubstr("to_rpm"));
  EXPECT_THAT(ErrorOf("position velocity", "position speed"), HasSubstr("'speed'"));
  EXPECT_THAT(ErrorOf("position velocity", "position"), HasSubstr("velocity"));
  EXPECT_THAT(ErrorOf("position velocity", "velocity 70000"), HasSubstr("70000"));
  EXPECT_THAT(ErrorOf("position velocity", ""), HasSubstr("no values"));
  EXPECT_THAT(ErrorOf("values = \"1\"", "values = \"position\""), HasSubstr("[[move]] only"));
  EXPECT_THAT(ErrorOf("values = \"1\"", "values = \"1 2\"\nfunction = 6"),
              HasSubstr("more values"));
  EXPECT_THAT(ErrorOf("values = \"1\"", "values = \"1\"\nfunction = 7"), HasSubstr("6 (one"));
  EXPECT_THAT(ErrorOf("values = \"1\"", "values = \"1\"\nwait_ms = 5000"), HasSubstr("1000"));
  EXPECT_THAT(ErrorOf("register = 0x30\nvalues = \"1\"", "register = 0xFFFF\nvalues = \"1 2\""),
              HasSubstr("0xFFFF"));
  EXPECT_THAT(ErrorOf("[[halt]]\nregister = 0x30\nvalues = \"2\"\n", ""), HasSubstr("[[halt]]"));
  EXPECT_THAT(ErrorOf("fault = 8", "fault = 8\nhomed_live = true"), HasSubstr("needs homed"));
  EXPECT_THAT(
      ErrorOf("[velocity]", "[fault]\nregister = 1\n[fault.codes]\nten = \"x\"\n[velocity]"),
      HasSubstr("small.toml:13:1"));
}

TEST(DriveProfileParser, TakesMemoryWithinBounds) {
  std::string many = "\"";
  for (int i = 0; i < 124; ++i) many += "1 ";
  EXPECT_THAT(ErrorOf("\"position velocity\"", many + "\""), HasSubstr("123"));
  std::string writes;
  for (int i = 0; i < 20; ++i) writes += "[[start]]\nregister = 1\nvalues = \"1\"\n";
  EXPECT_THAT(ErrorOf("[[move]]", writes + "[[move]]"), HasSubstr("more than 16"));
  std::string codes = "[fault]\nregister = 1\n[fault.codes]\n";
  for (int i = 0; i < 600; ++i) codes += std::to_string(i) + " = \"x\"\n";
  EXPECT_THAT(ErrorOf("[velocity]", codes + "[velocity]"), HasSubstr("512"));
}

TEST(LoadDriveProfile, AFileBesideTheRigFile) {
  const auto directory =
      std::filesystem::path(testing::TempDir()) / ("modbus-profile-" + std::to_string(getpid()));
  std::filesystem::create_directories(directory);
  std::ofstream(directory / "mine.toml") << kSmall;
  std::ofstream(directory / "bad.toml") << "model = 3\n";
  std::ofstream(directory / "large.toml") << std::string(300 << 10, '#');
  absl::StatusOr<DriveProfile> mine = LoadDriveProfile("mine.toml", directory.string());
  ASSERT_TRUE(mine.ok()) << mine.status();
  EXPECT_EQ(mine->model, "small");
  EXPECT_EQ(mine->name, "mine.toml");
  EXPECT_THAT(MessageOf(LoadDriveProfile("bad.toml", directory.string()).status()),
              HasSubstr("bad.toml:1:1"));
  EXPECT_EQ(ErrorReason(LoadDriveProfile("large.toml", directory.string()).status()),
            "PROFILE_TOO_LARGE");
  EXPECT_FALSE(LoadDriveProfile("none.toml", directory.string()).ok());
  const absl::Status unknown = LoadDriveProfile("acme", "").status();
  EXPECT_EQ(ErrorReason(unknown), "PROFILE_UNKNOWN");
  EXPECT_THAT(MessageOf(unknown), HasSubstr("oriental-motor-az"));
  std::filesystem::remove_all(directory);
}

}  // namespace
}  // namespace lightstage
