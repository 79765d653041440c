#include <gtest/gtest.h>

#include "drivers/dlpc350/driver.h"

namespace lightstage {
namespace {

TEST(Dlpc350Driver, SaysThatItWasNotBuilt) {
  absl::StatusOr<TomlDocument> document =
      TomlDocument::Parse("[projector]\ndriver = \"dlpc350\"\nmode = \"flash\"\n", "rig.toml");
  ASSERT_TRUE(document.ok());
  Dlpc350Driver().parse(document->root().Table("projector"));
  absl::Status status = document->Finish();
  EXPECT_FALSE(status.ok());
  EXPECT_NE(status.message().find("rig.toml:2"), std::string_view::npos) << status;
  EXPECT_NE(status.message().find("libhidapi-dev"), std::string_view::npos) << status;
  EXPECT_EQ(ErrorReason(Dlpc350Discovery()().status()), "DRIVER_NOT_BUILT");
}

}  // namespace
}  // namespace lightstage
