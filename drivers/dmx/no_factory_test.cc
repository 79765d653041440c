#include <gtest/gtest.h>

#include "drivers/dmx/driver.h"

namespace lightstage {
namespace {

TEST(DmxDriver, SaysThatItWasNotBuilt) {
  absl::StatusOr<TomlDocument> document =
      TomlDocument::Parse("[lamps]\ndriver = \"dmx\"\nserial = \"A\"\n", "rig.toml");
  ASSERT_TRUE(document.ok());
  DmxDriver().parse(document->root().Table("lamps"));
  absl::Status status = document->Finish();
  EXPECT_FALSE(status.ok());
  EXPECT_NE(status.message().find("rig.toml:2"), std::string_view::npos) << status;
  EXPECT_NE(status.message().find("libusb-1.0-0-dev"), std::string_view::npos) << status;
  EXPECT_EQ(ErrorReason(DmxDiscovery()().status()), "DRIVER_NOT_BUILT");
}

}  // namespace
}  // namespace lightstage
