// What a camera sees of light and motion over time.
#include "sim/rig/world.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "base/status.h"
#include "sim/rig/test_rig.h"

namespace lightstage::sim {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr FilmSize kSize{32, 24};

class WorldTest : public testing::Test {
 protected:
  static std::shared_ptr<World> Make(Clock& clock, WorldOptions options = {}) {
    options.samples = 2;
    auto world = World::Create(options, Rig(), clock);
    EXPECT_TRUE(world.ok()) << world.status();
    return *world;
  }
  Image See(TimePoint start, Duration exposure) {
    auto image = world_->Integrate(start, start + exposure, kSize);
    EXPECT_TRUE(image.ok()) << image.status();
    return *image;
  }
  // One lamp all the time, seen at a turntable angle.
  Image Still(int lamp, double azimuth_deg, Duration exposure) {
    VirtualClock clock;
    auto world = Make(clock);
    std::vector<float> levels(3);
    levels[lamp] = 1;
    world->RampLamps(clock.Now(), {}, {}, levels);
    world->SetMotion(AxisRole::kTurntable, {{.start = clock.Now(), .position = azimuth_deg}});
    auto image = world->Integrate(clock.Now(), clock.Now() + exposure, kSize);
    EXPECT_TRUE(image.ok());
    return *image;
  }
  static double Sum(const Image& image) {
    double sum = 0;
    for (float v : image.pixels()) sum += v;
    return sum;
  }
  // Mean difference of a from b, relative to b's mean.
  static double Difference(const Image& a, const Image& b) {
    double sum = 0;
    for (size_t i = 0; i < a.pixels().size(); ++i) sum += std::abs(a.pixels()[i] - b.pixels()[i]);
    return sum / Sum(b);
  }
  // Greatest difference from Σ weight·image, relative to the brightest pixel.
  static double Off(const Image& image, const std::vector<std::pair<double, const Image*>>& parts) {
    double worst = 0, brightest = 0;
    for (size_t i = 0; i < image.pixels().size(); ++i) {
      double expected = 0;
      for (const auto& [weight, part] : parts) expected += weight * part->pixels()[i];
      worst = std::max(worst, std::abs(image.pixels()[i] - expected));
      brightest = std::max(brightest, expected);
    }
    EXPECT_GT(brightest, 0);
    return worst / brightest;
  }

  VirtualClock clock_;
  std::shared_ptr<World> world_ = Make(clock_);
  const TimePoint t0_ = clock_.Now();
};

TEST_F(WorldTest, DarkWithoutLight) { EXPECT_EQ(Sum(See(t0_, milliseconds(10))), 0); }

TEST_F(WorldTest, LightAdds) {
  world_->RampLamps(t0_, {}, {}, {1, 0, 0});
  const Image a = See(t0_, milliseconds(10));
  world_->RampLamps(t0_ + seconds(1), {}, {}, {0, 0.5f, 0});
  const Image b = See(t0_ + seconds(1), milliseconds(10));
  world_->RampLamps(t0_ + seconds(2), {}, {}, {1, 0.5f, 0});
  EXPECT_LT(Off(See(t0_ + seconds(2), milliseconds(10)), {{1, &a}, {1, &b}}), 1e-6);
  EXPECT_LT(Off(See(t0_ + seconds(2), milliseconds(30)), {{3, &a}, {3, &b}}), 1e-6);
}

TEST_F(WorldTest, LightChangedTooEarlyShowsInProportion) {
  const Image a = Still(0, 0, milliseconds(10)), b = Still(1, 0, milliseconds(10));
  world_->RampLamps(t0_, {}, {}, {1, 0, 0});
  // Changed after 7 of 10 ms.
  world_->RampLamps(t0_ + milliseconds(7), {}, {}, {0, 1, 0});
  EXPECT_LT(Off(See(t0_, milliseconds(10)), {{0.7, &a}, {0.3, &b}}), 1e-6);
}

TEST_F(WorldTest, LightSwitchedOnTooLateIsMissedInProportion) {
  const Image a = Still(0, 0, milliseconds(10));
  // Rising over the first 4 of 10 ms: half of that is lost.
  world_->RampLamps(t0_, milliseconds(4), milliseconds(4), {1, 0, 0});
  EXPECT_LT(Off(See(t0_, milliseconds(10)), {{0.8, &a}}), 1e-6);
}

TEST_F(WorldTest, PatternsFadeIntoEachOther) {
  const Pattern left{PatternArrangement::kSquare, PatternProfile::kBox, 2, 0, 0, 1};
  const Pattern full{PatternArrangement::kFull};
  world_->RampProjection(t0_, t0_, left);
  EXPECT_EQ(std::get<Pattern>(world_->Shown(t0_)), left);
  const Image a = See(t0_, milliseconds(10));
  world_->RampProjection(t0_ + seconds(1), t0_ + seconds(1), full);
  const Image b = See(t0_ + seconds(1), milliseconds(10));
  EXPECT_GT(Sum(b), 1.5 * Sum(a));
  world_->RampProjection(t0_ + seconds(2), t0_ + seconds(2) + milliseconds(10), left);
  EXPECT_LT(Off(See(t0_ + seconds(2), milliseconds(10)), {{0.5, &a}, {0.5, &b}}), 1e-5);
  world_->RampProjection(t0_ + seconds(3), t0_ + seconds(3), Pattern{});
  EXPECT_EQ(Sum(See(t0_ + seconds(3), milliseconds(10))), 0);
  EXPECT_EQ(std::get<Pattern>(world_->Shown(t0_ + seconds(3))), Pattern{});
}

// The codes of a pattern of zeros and ones shine as the pattern does, and half the code half as much.
TEST_F(WorldTest, PixelsShineAsTheirCodesSay) {
  const Pattern left{PatternArrangement::kSquare, PatternProfile::kBox, 2, 0, 0, 1};
  const ProjectorGeometry& projector = world_->geometry().projector;
  const Image raster = Rasterize(left, projector.width, projector.height);
  const auto codes = [&](float one) {
    std::vector<uint8_t> bytes;
    for (float value : raster.pixels()) bytes.push_back(static_cast<uint8_t>(value * one));
    return std::make_shared<const std::vector<uint8_t>>(std::move(bytes));
  };
  world_->RampProjection(t0_, t0_, left);
  const Image exact = See(t0_, milliseconds(10));
  world_->RampProjection(t0_ + seconds(1), t0_ + seconds(1), codes(255));
  EXPECT_EQ(Off(See(t0_ + seconds(1), milliseconds(10)), {{1, &exact}}), 0);
  world_->RampProjection(t0_ + seconds(2), t0_ + seconds(2), codes(51));
  EXPECT_LT(Off(See(t0_ + seconds(2), milliseconds(10)), {{0.2, &exact}}), 1e-6);
  world_->RampProjection(t0_ + seconds(3), t0_ + seconds(3), codes(0));
  EXPECT_EQ(Sum(See(t0_ + seconds(3), milliseconds(10))), 0);
}

TEST_F(WorldTest, MovingTableSmears) {
  world_->RampLamps(t0_, {}, {}, {0, 0, 1});
  // 8° in a second, evenly but for the ends.
  world_->SetMotion(AxisRole::kTurntable, Travel(t0_, 30, 8, 38, 8.008, {8000, {}, 0}));
  const Image smeared = See(t0_, seconds(1));
  const Image still = See(t0_ + seconds(2), seconds(1));
  // What it should be: the mean over many still poses.
  Image mean(kSize.width, kSize.height, 3);
  constexpr int kPoses = 16;
  for (int i = 0; i < kPoses; ++i) {
    const TimePoint t = t0_ + seconds(3 + i);
    world_->SetMotion(AxisRole::kTurntable,
                      {{.start = t, .position = 30 + 8 * (i + 0.5) / kPoses}});
    const Image pose = See(t, seconds(1));
    for (size_t k = 0; k < mean.pixels().size(); ++k) mean.pixels()[k] += pose.pixels()[k] / kPoses;
  }
  EXPECT_LT(Difference(smeared, mean), 0.3 * Difference(still, mean));
  EXPECT_GT(Difference(still, mean), 0.02);
}

TEST_F(WorldTest, StandingTableDoesNot) {
  world_->RampLamps(t0_, {}, {}, {0, 0, 1});
  world_->SetMotion(AxisRole::kTurntable,
                    Travel(t0_, 0, 30, 30, 20, {40, milliseconds(100), 0.05}));
  const TimePoint settled = t0_ + seconds(10);
  const Image image = See(settled, milliseconds(10)), still = Still(2, 30, milliseconds(10));
  EXPECT_EQ(Off(image, {{1, &still}}), 0);
}

TEST_F(WorldTest, NoiseDependsOnTheShotAlone) {
  auto frame = [](World& world, TimePoint start) {
    auto frame = world.Expose(start, start + milliseconds(20), PixelFormat::kRGB16, kSize, 12);
    EXPECT_TRUE(frame.ok()) << frame.status();
    return frame->data;
  };
  // Another life before this shot: other lights, other motions, another time of day.
  world_->RampLamps(t0_, milliseconds(3), milliseconds(3), {1, 1, 1});
  world_->SetMotion(AxisRole::kTurntable, Travel(t0_, 0, -170, -170, 20, {40, {}, 0}));
  const TimePoint later = t0_ + seconds(30) + Duration(12345);
  frame(*world_, t0_ + seconds(20));
  world_->SetMotion(AxisRole::kTurntable, Travel(later, -170, 17.5, -152.5, 20, {40, {}, 0}));
  world_->RampLamps(later + seconds(5), milliseconds(2), milliseconds(2), {0, 1, 0});
  const auto a = frame(*world_, later + seconds(6));
  // … and a world that has just been made.
  VirtualClock clock;
  auto fresh = Make(clock);
  fresh->SetMotion(AxisRole::kTurntable, Travel(t0_, 0, 207.5, 207.5, 20, {40, {}, 0}));
  fresh->RampLamps(t0_ + seconds(20), {}, {}, {0, 1, 0});
  EXPECT_EQ(frame(*fresh, t0_ + seconds(30)), a);
  WorldOptions other;
  other.seed = 2;
  auto reseeded = Make(clock, other);
  reseeded->SetMotion(AxisRole::kTurntable, {{.start = t0_, .position = 207.5}});
  reseeded->RampLamps(t0_, {}, {}, {0, 1, 0});
  EXPECT_NE(frame(*reseeded, t0_ + seconds(30)), a);
}

TEST_F(WorldTest, ForgetsOldHistory) {
  for (int i = 0; i < 1000; ++i) {
    const TimePoint t = t0_ + seconds(i);
    world_->RampLamps(t, {}, {}, {i % 2 == 0 ? 1.0f : 0.0f, 0, 0});
  }
  const TimePoint now = t0_ + seconds(999);
  EXPECT_TRUE(world_->Integrate(now - seconds(10), now, kSize).ok());
  EXPECT_EQ(world_->Integrate(now - seconds(70), now, kSize).status().code(),
            absl::StatusCode::kOutOfRange);
}

TEST_F(WorldTest, ExposeNowEndsNow) {
  world_->RampLamps(t0_ + milliseconds(50), {}, {}, {1, 0, 0});
  SleepFor(clock_, milliseconds(100));
  auto frame = world_->ExposeNow(milliseconds(80), PixelFormat::kMono8, kSize, 12);
  ASSERT_TRUE(frame.ok()) << frame.status();
  EXPECT_EQ(frame->exposure_end, clock_.Now());
  EXPECT_EQ(frame->exposure_start, clock_.Now() - milliseconds(80));
  EXPECT_EQ(frame->data.size(), 32u * 24u);
  EXPECT_EQ(frame->significant_bits, 8);
}

TEST(World, UnknownSceneIsRefused) {
  VirtualClock clock;
  WorldOptions options;
  options.scene = "nowhere";
  EXPECT_EQ(World::Create(options, Rig(), clock).status().code(), absl::StatusCode::kNotFound);
}

TEST(World, ASceneThatCannotBeBuiltIsNamed) {
  VirtualClock clock;
  WorldOptions options;
  options.scene_directory = testing::TempDir();
  options.scene = "lightstage_world_test.toml";
  const std::string file = options.scene_directory + options.scene;
  const std::string foam = "[material.m]\nkind = \"medium\"\nmean_free_path_m = 0.01\n",
                    ball = "[[ball]]\nradius_m = 0.05\nmaterial = \"m\"\n";
  std::ofstream(file) << foam << ball << ball;
  absl::Status status = World::Create(options, Rig(), clock).status();
  EXPECT_TRUE(MessageOf(status).starts_with(options.scene)) << status;
  std::ofstream(file) << foam << "[[ball]]\nradius_m = 10\nmaterial = \"m\"\n";
  status = World::Create(options, Rig(), clock).status();
  EXPECT_TRUE(MessageOf(status).starts_with(options.scene)) << status;
  EXPECT_NE(status.message().find("the camera"), std::string::npos) << status;
}

}  // namespace
}  // namespace lightstage::sim
