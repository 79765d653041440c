#include "daemon/calibrate/light_seen.h"

#include "base/status.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace lightstage {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

TEST(LightSeen, RowMeansAreOfAllSamplesOfARow) {
  Frame frame;
  frame.width = 2;
  frame.height = 2;
  const auto bytes = [&](const std::vector<int>& values) {
    frame.data.clear();
    for (int value : values) frame.data.push_back(static_cast<std::byte>(value));
  };
  frame.format = PixelFormat::kMono8;
  bytes({10, 20, 200, 255});
  EXPECT_THAT(RowMeansOf(frame), ElementsAre(15, 227.5));
  frame.format = PixelFormat::kMono16;
  bytes({0, 1, 2, 3, 0xff, 0xff, 0, 0});
  EXPECT_THAT(RowMeansOf(frame), ElementsAre((256 + 770) / 2.0, 65535 / 2.0));
  frame.format = PixelFormat::kRGB8;
  bytes({6, 12, 18, 0, 0, 0, 1, 1, 1, 1, 1, 1});
  EXPECT_THAT(RowMeansOf(frame), ElementsAre(6, 1));
}

TEST(LightSeen, ALittleLightInOneRowIsSeenAndNoiseIsNot) {
  const auto seen =
      LightSeen::Learn({{10, 10, 10}, {11, 11, 11}}, {{210, 211, 212}, {212, 211, 210}});
  ASSERT_TRUE(seen.ok()) << seen.status();
  EXPECT_FALSE(seen->Any({10, 11, 11.5}));
  EXPECT_TRUE(seen->Any({18, 10, 10}));
  EXPECT_TRUE(seen->Any({10, 10, 18}));
  // What is seen is not less than it says.
  EXPECT_TRUE(seen->Any({10, 10 + seen->unseen() * 0.8 * 200.1, 10}));
  EXPECT_LT(seen->unseen(), 0.04);
  EXPECT_FALSE(seen->Whole({210, 11, 100}));
  EXPECT_FALSE(seen->Whole({100, 11, 210}));
  EXPECT_FALSE(seen->Whole({210, 211, 160}));
  EXPECT_TRUE(seen->Whole({180, 11, 180}));
}

// Between them there may be something black.
TEST(LightSeen, OnlyTheFirstAndTheLastRowMustShowTheLight) {
  const auto seen =
      LightSeen::Learn({{10, 10, 10}, {10, 10, 10}}, {{210, 11, 210}, {210, 12, 210}});
  ASSERT_TRUE(seen.ok()) << seen.status();
  EXPECT_FALSE(seen->Any({10, 100, 10}));
  for (const RowMeans& lit : {RowMeans{11, 210, 210}, RowMeans{210, 210, 11}}) {
    const absl::Status refused =
        LightSeen::Learn({{10, 10, 10}, {10, 10, 10}}, {lit, lit}).status();
    EXPECT_EQ(ErrorReason(refused), "LIGHT_NOT_SEEN");
    EXPECT_THAT(MessageOf(refused), HasSubstr(lit.front() < 100 ? "row 0" : "row 2"));
  }
}

TEST(LightSeen, NoiseAndFlickerAsLargeAsTheLightAreRefused) {
  EXPECT_EQ(ErrorReason(LightSeen::Learn({{10}, {30}}, {{110}, {110}}).status()), "LIGHT_NOT_SEEN");
  EXPECT_EQ(ErrorReason(LightSeen::Learn({{10}, {10}}, {{12}, {110}}).status()), "LIGHT_NOT_SEEN");
  // Of a few codes a small share would be rounded away.
  EXPECT_EQ(ErrorReason(LightSeen::Learn({{0}, {0}}, {{10}, {10}}).status()), "LIGHT_NOT_SEEN");
  EXPECT_TRUE(LightSeen::Learn({{0}, {0}}, {{16}, {16}}).ok());
}

}  // namespace
}  // namespace lightstage
