// Where libjpeg-turbo was missing the rig file is refused that asks for what needs it.
#include <gtest/gtest.h>

#include "base/status.h"
#include "drivers/v4l2/jpeg.h"
#include "drivers/v4l2/options.h"

namespace lightstage {
namespace {

TEST(NoJpeg, MotionJpegIsRefusedAndSaysWhatIsMissing) {
  auto document = TomlDocument::Parse("card = \"x\"\nfourcc = \"MJPG\"\n", "rig.toml");
  ASSERT_TRUE(document.ok());
  ParseV4l2Options(document->root());
  const std::string refused = MessageOf(document->Finish());
  EXPECT_NE(refused.find("libturbojpeg0-dev"), std::string::npos) << refused;
  EXPECT_EQ(ErrorReason(DecodeJpeg({}, 1, 1, PixelFormat::kMono8).status()), "NOT_BUILT");
}

}  // namespace
}  // namespace lightstage
