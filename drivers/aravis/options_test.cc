#include "drivers/aravis/options.h"

#include <gtest/gtest.h>

namespace lightstage {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;

absl::Status Parse(const std::string& text, AravisOptions* options) {
  absl::StatusOr<TomlDocument> document = TomlDocument::Parse("[camera]\n" + text, "rig.toml");
  if (!document.ok()) return document.status();
  *options = ParseAravisOptions(document->root().Table("camera"));
  return document->Finish();
}

TEST(AravisOptions, EveryKeyIsRead) {
  AravisOptions options;
  absl::Status status = Parse(
      "address = \"192.168.7.2\"\nserial = \"17\"\npacket_size = 9000\npacket_timeout_ms = 40\n"
      "frame_retention_ms = 150\npacket_socket = true\nexposure_end_margin_us = 250\n"
      "gain_db_per_step = 0.1\nreadout_ms = 12.5\npixel_format = \"Mono12p\"\n"
      "chunk_data = false\n",
      &options);
  ASSERT_TRUE(status.ok()) << status;
  EXPECT_EQ(options.address, "192.168.7.2");
  EXPECT_EQ(options.serial, "17");
  EXPECT_EQ(options.pixel_format, "Mono12p");
  EXPECT_FALSE(options.chunk_data);
  EXPECT_EQ(options.packet_size, 9000);
  EXPECT_EQ(options.packet_timeout, milliseconds(40));
  EXPECT_EQ(options.frame_retention, milliseconds(150));
  EXPECT_TRUE(options.packet_socket);
  EXPECT_EQ(options.exposure_end_margin, microseconds(250));
  EXPECT_DOUBLE_EQ(options.gain_db_per_step, 0.1);
  EXPECT_EQ(options.readout, microseconds(12500));
}

TEST(AravisOptions, DefaultsLeaveTheCameraAlone) {
  AravisOptions options;
  ASSERT_TRUE(Parse("serial = \"17\"\n", &options).ok());
  EXPECT_FALSE(options.packet_size.has_value());
  EXPECT_FALSE(options.packet_socket);
  EXPECT_FALSE(options.exposure_end_margin.has_value());
}

TEST(AravisOptions, NeitherAddressNorSerialIsRefused) {
  AravisOptions options;
  absl::Status status = Parse("packet_size = 1500\n", &options);
  EXPECT_FALSE(status.ok());
  EXPECT_NE(status.message().find("address"), std::string_view::npos) << status;
}

TEST(AravisOptions, Lines) {
  AravisOptions options;
  ASSERT_TRUE(Parse("serial = \"17\"\n", &options).ok());
  EXPECT_TRUE(options.SoftwareTriggered());
  ASSERT_TRUE(Parse("serial = \"17\"\ntrigger_source = \"Line1\"\n", &options).ok());
  EXPECT_FALSE(options.SoftwareTriggered());
  EXPECT_EQ(options.trigger_activation, "RisingEdge");
  ASSERT_TRUE(Parse("serial = \"17\"\ntrigger_source = \"Line1\"\n"
                    "trigger_activation = \"FallingEdge\"\nexposure_active_line = \"Line2\"\n",
                    &options)
                  .ok());
  EXPECT_EQ(options.trigger_activation, "FallingEdge");
  EXPECT_EQ(options.exposure_active_line, "Line2");
}

TEST(AravisOptions, LinesThatContradictEachOtherAreRefused) {
  for (const char* bad : {"trigger_activation = \"FallingEdge\"",
                          "trigger_source = \"Line1\"\ntrigger_activation = \"AnyEdge\"",
                          "trigger_source = \"Line1\"\nexposure_active_line = \"Line1\"",
                          "trigger_source = \"Line1\"\nexposure_end_margin_us = 100"}) {
    AravisOptions options;
    EXPECT_FALSE(Parse(std::string("serial = \"17\"\n") + bad + "\n", &options).ok()) << bad;
  }
}

TEST(AravisOptions, UnknownPixelFormatNamesTheKnownOnes) {
  AravisOptions options;
  absl::Status status = Parse("serial = \"17\"\npixel_format = \"Mono12P\"\n", &options);
  EXPECT_NE(status.message().find("\"Mono12P\" is not known; known: Mono8, Mono16"),
            std::string_view::npos)
      << status;
}

TEST(AravisOptions, BadValuesAndUnknownKeysAreRefused) {
  AravisOptions options;
  for (const char* bad : {"packet_size = 100", "packet_size = 70000", "packet_timeout_ms = -1",
                          "gain_db_per_step = nan", "adress = \"1.2.3.4\"", "packet_socket = 1"}) {
    EXPECT_FALSE(Parse(std::string("serial = \"17\"\n") + bad + "\n", &options).ok()) << bad;
  }
}

}  // namespace
}  // namespace lightstage
