#include "drivers/dmx/discovery.h"

#include <gtest/gtest.h>

namespace lightstage::dmx {
namespace {

// As two widgets say it themselves (github.com/jaysonh/Dmx4Artists, issue 7).
const UsbIdentity kBare = {"1-2", "FTDI", "FT232R USB UART", "AQ02FHLY", ""};
const UsbIdentity kPro = {"1-3.1", "ENTTEC", "DMX USB PRO", "EN396804", ""};

TEST(DmxDiscovery, TellsTheWidgetsApart) {
  EXPECT_EQ(LooksLike(kBare), WidgetKind::kOpen);
  EXPECT_EQ(LooksLike(kPro), WidgetKind::kPro);
  EXPECT_FALSE(LooksLike({"1-4", "QEMU", "QEMU USB SERIAL", "1", ""}).has_value());
  EXPECT_FALSE(LooksLike({"1-4", "", "", "", "no permission"}).has_value());
}

// What it proposes is a table that the driver reads, once the lab's own lines are filled in.
TEST(DmxDiscovery, ProposesATableThatCanBeRead) {
  const UsbIdentity odd = {"2-1", "x", "DMX\x01 \"pro\" \\ \xFF", "a\"b\\c\n", ""};
  const UsbIdentity nameless = {"2-2.4", "", "", "", "permission denied"};
  const std::vector<Discovered> found = Describe({kBare, kPro, odd, nameless});
  ASSERT_EQ(found.size(), 4u);
  EXPECT_NE(found[0].what.find("AQ02FHLY"), std::string::npos) << found[0].what;
  EXPECT_NE(found[1].what.find("a DMX USB Pro"), std::string::npos) << found[1].what;
  EXPECT_NE(found[3].what.find("permission denied"), std::string::npos) << found[3].what;
  for (const Discovered& one : found) {
    std::string toml = one.toml;
    for (size_t at; (at = toml.find("# ")) != std::string::npos;) toml.erase(at, 2);
    absl::StatusOr<TomlDocument> document = TomlDocument::Parse(toml, "rig.toml");
    ASSERT_TRUE(document.ok()) << document.status() << "\n" << toml;
    document->root().Table("lamps").String("driver");
    const DmxOptions options = ParseDmxOptions(document->root().Table("lamps"));
    EXPECT_TRUE(document->Finish().ok()) << document->Finish() << "\n" << toml;
    EXPECT_EQ(options.channels.first.size(), 8u);
  }
}

TEST(SelectDevice, ByAllThatIsSaid) {
  const std::vector<UsbIdentity> devices = {kBare, kPro, {"1-9", "FTDI", "FT232R", "AQ02FHLY", ""}};
  EXPECT_EQ(*SelectDevice(devices, {"EN396804", ""}), 1u);
  EXPECT_EQ(*SelectDevice(devices, {"", "1-3.1"}), 1u);
  EXPECT_EQ(*SelectDevice(devices, {"AQ02FHLY", "1-9"}), 2u);
  const absl::Status two = SelectDevice(devices, {"AQ02FHLY", ""}).status();
  EXPECT_EQ(ErrorReason(two), "DEVICE_AMBIGUOUS") << two;
  EXPECT_NE(two.message().find("1-9"), std::string_view::npos) << two;
  for (const UsbSelector& wrong : {UsbSelector{"EN396804", "1-2"}, UsbSelector{"", "1-3"}}) {
    const absl::Status none = SelectDevice(devices, wrong).status();
    EXPECT_EQ(ErrorReason(none), "DEVICE_LOST") << none;
    EXPECT_NE(none.message().find("EN396804"), std::string_view::npos) << "names what there is";
  }
  EXPECT_EQ(ErrorReason(SelectDevice({}, {"A", ""}).status()), "DEVICE_LOST");
}

}  // namespace
}  // namespace lightstage::dmx
