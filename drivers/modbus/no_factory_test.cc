#include <gtest/gtest.h>

#include "drivers/modbus/driver.h"

namespace lightstage {
namespace {

TEST(ModbusDriver, SaysThatItWasNotBuilt) {
  absl::StatusOr<TomlDocument> document = TomlDocument::Parse(
      "[turntable]\ndriver = \"modbus\"\nunit = 2\n[lamps]\ndriver = \"modbus\"\ncount = 40\n",
      "rig.toml");
  ASSERT_TRUE(document.ok());
  ModbusAxisDriver().parse(document->root().Table("turntable"));
  ModbusLampsDriver().parse(document->root().Table("lamps"));
  absl::Status status = document->Finish();
  EXPECT_FALSE(status.ok());
  EXPECT_NE(status.message().find("rig.toml:2"), std::string_view::npos) << status;
  EXPECT_NE(status.message().find("rig.toml:5"), std::string_view::npos) << status;
  EXPECT_NE(status.message().find("libmodbus-dev"), std::string_view::npos) << status;
  EXPECT_EQ(ErrorReason(ModbusDiscovery()().status()), "DRIVER_NOT_BUILT");
}

}  // namespace
}  // namespace lightstage
