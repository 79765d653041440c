#include <gtest/gtest.h>

#include "drivers/aravis/driver.h"

namespace lightstage {
namespace {

TEST(AravisDriver, SaysThatItWasNotBuilt) {
  absl::StatusOr<TomlDocument> document =
      TomlDocument::Parse("[camera]\ndriver = \"aravis\"\naddress = \"10.0.0.2\"\n", "rig.toml");
  ASSERT_TRUE(document.ok());
  AravisDriver().parse(document->root().Table("camera"));
  absl::Status status = document->Finish();
  EXPECT_FALSE(status.ok());
  EXPECT_NE(status.message().find("rig.toml:2"), std::string_view::npos) << status;
  EXPECT_NE(status.message().find("libaravis-dev"), std::string_view::npos) << status;
}

}  // namespace
}  // namespace lightstage
