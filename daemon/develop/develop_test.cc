#include "daemon/develop/develop.h"

#include <chrono>
#include <cmath>
#include <cstring>

#include "base/status.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace lightstage {
namespace {

using std::chrono::milliseconds;
using ::testing::HasSubstr;

DevelopOptions Options() {
  DevelopOptions options;
  options.black_level = 100;
  options.noise_floor = 0.002;
  options.saturation = 0.98;
  return options;
}

RigGeometry Geometry() {
  RigGeometry geometry;
  geometry.brace.radius = Meters(1);
  for (double tilt : {2.25, 45.0, 87.75}) {
    geometry.brace.lamps.push_back({Degrees(0), Degrees(tilt)});
  }
  geometry.brace.lamps.push_back({Degrees(180), Degrees(45)});
  geometry.brace.lamps.push_back({Degrees(0), Degrees(135)});  // opposite to lamp 3
  geometry.projector = {true, Meters(1.5), Degrees(30), Degrees(40), 64, 64};
  return geometry;
}

// Frames of a scene given as light (share of full scale per second) by pixel and channel.
template <class Light>
RawShot Shoot(PixelFormat format, int bits, int width, int height,
              const std::vector<milliseconds>& exposures, Light light) {
  RawShot raw;
  raw.shot.id = 17;
  raw.shot.condition.lamps = {{1, 1.0}};
  const double full = std::exp2(bits) - 1;
  for (milliseconds exposure : exposures) {
    Frame frame{.format = format, .width = width, .height = height, .significant_bits = bits};
    frame.exposure = exposure;
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        for (int c = 0; c < SamplesPerPixel(format); ++c) {
          double e = light(x, y, c) * std::chrono::duration<double>(exposure).count();
          uint16_t code = std::lround(100 + std::min(1.0, e) * (full - 100));
          for (int b = 0; b < BytesPerSample(format); ++b) {
            frame.data.push_back(std::byte(code >> (8 * b) & 255));
          }
        }
      }
    }
    raw.frames.push_back(std::move(frame));
    raw.shot.exposures.push_back(exposure);
    raw.exposures.push_back({});
  }
  return raw;
}

constexpr int kBelow = 0;

TEST(Develop, MergesAnRgbBracket) {
  // One pixel per decade: black, dim, middle, bright, beyond the range.
  const double levels[] = {0, 0.5, 20, 300, 5000};
  const double colour[] = {1, 0.5, 0.25};
  RawShot raw = Shoot(PixelFormat::kRGB16, 12, 5, 1, {milliseconds(1), milliseconds(30)},
                      [&](int x, int, int c) { return levels[x] * colour[c]; });
  auto developed = Develop(raw, Options(), Geometry());
  ASSERT_TRUE(developed.ok()) << developed.status();
  const BasisImage& image = developed->image;
  EXPECT_EQ(image.pixels.channels(), 3);
  EXPECT_EQ(image.flags, (std::vector<uint8_t>{kBelowRange, 0, 0, 0, kAboveRange}));
  for (int c = 0; c < 3; ++c) {
    EXPECT_EQ(image.pixels.at(kBelow, 0, c), 0);
    for (int x : {1, 2, 3}) {
      // Half a code of the better exposure.
      EXPECT_NEAR(image.pixels.at(x, 0, c) / (levels[x] * colour[c]), 1, x == 1 ? 0.15 : 0.02);
    }
  }
  EXPECT_GE(image.pixels.at(4, 0, 0), 950);
  EXPECT_DOUBLE_EQ(developed->checks.saturated_share, 0.2);
  EXPECT_DOUBLE_EQ(developed->checks.black_share, 0.2);
  EXPECT_NEAR(developed->checks.mean, (0.5 + 20 + 300) * 1.75 / 3 / 4, 1);
  EXPECT_GE(developed->checks.maximum, 950);
  EXPECT_FALSE(developed->checks.nothing_seen);
}

TEST(Develop, EveryMonoAndBayerFormatGivesTheSameLight) {
  const double colour[] = {8, 4, 2};
  struct Case {
    PixelFormat format;
    int red_x, red_y;
  };
  for (int bits : {8, 16}) {
    DevelopOptions options = Options();
    for (Case c : {Case{PixelFormat::kBayerRG8, 0, 0}, Case{PixelFormat::kBayerGR8, 1, 0},
                   Case{PixelFormat::kBayerGB8, 0, 1}, Case{PixelFormat::kBayerBG8, 1, 1}}) {
      PixelFormat format = PixelFormat(int(c.format) + (bits == 16 ? 4 : 0));
      ASSERT_EQ(BytesPerSample(format), bits / 8);
      RawShot raw = Shoot(format, bits, 6, 4, {milliseconds(100)}, [&](int x, int y, int) {
        bool rc = (x & 1) == c.red_x, rr = (y & 1) == c.red_y;
        return colour[rc == rr ? (rr ? 0 : 2) : 1];
      });
      auto developed = Develop(raw, options, Geometry());
      ASSERT_TRUE(developed.ok()) << developed.status();
      for (int k = 0; k < 3; ++k) {
        EXPECT_NEAR(developed->image.pixels.at(3, 2, k), colour[k], 0.04)
            << PixelFormatName(format);
      }
      EXPECT_EQ(developed->image.flags, std::vector<uint8_t>(24));
    }
    RawShot mono = Shoot(bits == 8 ? PixelFormat::kMono8 : PixelFormat::kMono16, bits, 3, 2,
                         {milliseconds(100)}, [](int x, int, int) { return x + 1.0; });
    auto developed = Develop(mono, options, Geometry());
    ASSERT_TRUE(developed.ok()) << developed.status();
    EXPECT_EQ(developed->image.pixels.channels(), 1);
    for (int x = 0; x < 3; ++x) EXPECT_NEAR(developed->image.pixels.at(x, 1, 0), x + 1, 0.04);
  }
}

TEST(Develop, UsesTheExposureThatTheCameraReported) {
  RawShot raw =
      Shoot(PixelFormat::kMono16, 12, 2, 2, {milliseconds(100)}, [](int, int, int) { return 5.0; });
  raw.shot.exposures = {milliseconds(50)};  // what was asked
  auto developed = Develop(raw, Options(), Geometry());
  EXPECT_NEAR(developed->image.pixels.at(0, 0, 0), 5, 0.01);
}

TEST(Develop, NothingSeenIsAboutLightNotSinglePixels) {
  auto seen = [](auto light, auto change) {
    RawShot raw = Shoot(PixelFormat::kMono16, 12, 40, 32, {milliseconds(10)}, light);
    change(raw);
    auto developed = Develop(raw, Options(), Geometry());
    EXPECT_TRUE(developed.ok()) << developed.status();
    return !developed->checks.nothing_seen;
  };
  auto keep = [](RawShot&) {};
  auto dark = [](int, int, int) { return 0.0; };
  auto hot = [](int x, int y, int) { return x % 8 == 3 && y % 8 == 5 ? 90.0 : 0.0; };
  auto highlight = [](int x, int y, int) { return x < 6 && y < 6 ? 10.0 : 0.0; };
  EXPECT_FALSE(seen(dark, keep));
  EXPECT_FALSE(seen(hot, keep));
  EXPECT_TRUE(seen(highlight, keep));
  // Nothing commanded: nothing is missing.
  EXPECT_TRUE(seen(dark, [](RawShot& raw) {
    raw.shot.kind = ShotKind::kDark;
    raw.shot.condition.lamps.clear();
  }));
  EXPECT_TRUE(seen(dark, [](RawShot& raw) { raw.shot.condition.lamps = {{1, 0.0}}; }));
  EXPECT_FALSE(seen(dark, [](RawShot& raw) {
    raw.shot.condition = {{}, Pattern{.arrangement = PatternArrangement::kFull}};
  }));
}

void ExpectDirection(std::optional<Vec3> d, const Vec3& expected) {
  ASSERT_TRUE(d.has_value());
  EXPECT_LT((*d - expected).norm(), 1e-12) << d->transpose();
}

TEST(LightDirection, IsInTheObjectFrame) {
  const RigGeometry geometry = Geometry();
  const Pose pose{Degrees(90), Degrees(60)};
  ExpectDirection(LightDirection({{{1, 0.5}}, {}}, pose, geometry),
                  DirectionFromAngles(Degrees(-90), Degrees(45)));
  // Two lamps of one level at ±45°: the zenith; one dark lamp does not count.
  ExpectDirection(LightDirection({{{1, 0.5}, {3, 0.5}, {2, 0.0}}, {}}, pose, geometry),
                  Vec3::UnitZ());
  ExpectDirection(
      LightDirection({{}, Pattern{.arrangement = PatternArrangement::kFull}}, pose, geometry),
      DirectionFromAngles(Degrees(-60), Degrees(60)));
  EXPECT_FALSE(LightDirection({}, pose, geometry));
  EXPECT_FALSE(LightDirection({{}, Pattern{}}, pose, geometry));
  EXPECT_FALSE(LightDirection({{{3, 1.0}, {4, 1.0}}, {}}, pose, geometry));  // opposite
  EXPECT_FALSE(LightDirection({{{1, 1.0}}, Pattern{.arrangement = PatternArrangement::kFull}}, pose,
                              geometry));
}

TEST(Develop, DirectionIsOfTheReportedPoseAndOnlyForBasisImages) {
  RawShot raw =
      Shoot(PixelFormat::kMono8, 8, 2, 2, {milliseconds(1)}, [](int, int, int) { return 1.0; });
  raw.shot.pose.azimuth = Degrees(90);
  raw.reported_pose.azimuth = Degrees(91);
  ExpectDirection(Develop(raw, Options(), Geometry())->direction,
                  DirectionFromAngles(Degrees(-91), Degrees(45)));
  raw.shot.kind = ShotKind::kReference;
  EXPECT_FALSE(Develop(raw, Options(), Geometry())->direction);
}

TEST(Develop, NamesWhatIsWrongWithAShot) {
  const RawShot good = Shoot(PixelFormat::kMono16, 12, 4, 4, {milliseconds(1), milliseconds(10)},
                             [](int, int, int) { return 1.0; });
  auto message = [&](auto change) {
    RawShot raw = good;
    change(raw);
    auto developed = Develop(raw, Options(), Geometry());
    EXPECT_FALSE(developed.ok());
    EXPECT_THAT(std::string(developed.status().message()), HasSubstr("shot 17"));
    return std::string(developed.status().message());
  };
  EXPECT_THAT(message([](RawShot& r) { r.frames.clear(); }), HasSubstr("0 frames for 2 exposures"));
  EXPECT_THAT(message([](RawShot& r) {
                r.frames.clear();
                r.shot.exposures.clear();
              }),
              HasSubstr("at least one"));
  EXPECT_THAT(message([](RawShot& r) { r.frames[1].width = 2; }), HasSubstr("frame 1 is 2×4"));
  EXPECT_THAT(message([](RawShot& r) { r.frames[1].data.pop_back(); }), HasSubstr("31 bytes"));
  EXPECT_THAT(message([](RawShot& r) { r.frames[0].exposure = {}; }), HasSubstr("exposure 0"));
  EXPECT_THAT(message([](RawShot& r) {
                for (Frame& f : r.frames) f.significant_bits = 20;
              }),
              HasSubstr("20 bits"));
  EXPECT_THAT(message([](RawShot& r) {
                r.shot.condition.lamps = {{40, 1.0}};
              }),
              HasSubstr("lamp 40"));
  EXPECT_THAT(message([](RawShot& r) {
                for (Frame& f : r.frames) f.width = f.height = 0, f.data.clear();
              }),
              HasSubstr("0×0"));
}

}  // namespace
}  // namespace lightstage
