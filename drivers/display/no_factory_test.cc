#include <gtest/gtest.h>

#include "drivers/display/driver.h"

namespace lightstage {
namespace {

TEST(DisplayDriver, SaysThatItWasNotBuilt) {
  absl::StatusOr<TomlDocument> document =
      TomlDocument::Parse("[projector]\ndriver = \"display\"\noutput = \"HDMI-1\"\n", "rig.toml");
  ASSERT_TRUE(document.ok());
  DisplayDriver().parse(document->root().Table("projector"));
  absl::Status status = document->Finish();
  EXPECT_FALSE(status.ok());
  EXPECT_NE(status.message().find("rig.toml:2"), std::string_view::npos) << status;
  EXPECT_NE(status.message().find("libsdl2-dev"), std::string_view::npos) << status;
  EXPECT_EQ(ErrorReason(DisplayDiscovery()().status()), "DRIVER_NOT_BUILT");
}

}  // namespace
}  // namespace lightstage
