#include "drivers/modbus/discovery.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "base/toml.h"
#include "drivers/modbus/driver.h"

namespace lightstage {
namespace {

class DiscoveryTest : public testing::Test {
 protected:
  DiscoveryTest()
      : directory_(std::filesystem::path(testing::TempDir()) /
                   ("modbus-discovery-" + std::to_string(getpid()))) {
    std::filesystem::create_directories(directory_);
  }
  ~DiscoveryTest() override { std::filesystem::remove_all(directory_); }
  const std::filesystem::path directory_;
};

TEST_F(DiscoveryTest, EverySerialPortWithTheLinesToPaste) {
  std::ofstream(directory_ / "usb-FTDI_USB-RS485-if00-port0") << "";
  std::ofstream(directory_ / "usb-1a86_USB_Serial-if00-port0") << "";
  auto found = DiscoverModbus(directory_.string());
  ASSERT_TRUE(found.ok()) << found.status();
  ASSERT_EQ(found->size(), 3u);
  EXPECT_NE((*found)[0].what.find("usb-1a86"), std::string::npos);
  EXPECT_NE((*found)[1].what.find("usb-FTDI"), std::string::npos);
  for (const Discovered& one : *found) {
    auto document = TomlDocument::Parse("[turntable]\n" + one.toml, "paste.toml");
    ASSERT_TRUE(document.ok()) << one.toml << document.status();
    EXPECT_EQ(document->root().Table("turntable").String("driver"), "modbus");
  }
  auto document = TomlDocument::Parse((*found)[1].toml, "paste.toml");
  EXPECT_EQ(document->root().String("serial_port"),
            (directory_ / "usb-FTDI_USB-RS485-if00-port0").string());
}

TEST_F(DiscoveryTest, SaysThatItDoesNotLookForDevicesOnTcp) {
  auto found = DiscoverModbus((directory_ / "none").string());
  ASSERT_TRUE(found.ok()) << found.status();
  ASSERT_EQ(found->size(), 1u);
  EXPECT_NE(found->front().what.find("not scanned"), std::string::npos);
}

TEST_F(DiscoveryTest, APlaceThatCannotBeReadIsAnError) {
  std::ofstream(directory_ / "file") << "";
  EXPECT_FALSE(DiscoverModbus((directory_ / "file").string()).ok());
}

TEST(ModbusDiscovery, LooksWithoutSpeaking) {
  auto found = ModbusDiscovery()();
  ASSERT_TRUE(found.ok()) << found.status();
  EXPECT_GE(found->size(), 1u);
}

}  // namespace
}  // namespace lightstage
