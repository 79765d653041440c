#include "tools/render/app.h"

#include <filesystem>
#include <sstream>

#include "dataset/exr.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace lightstage::sim {
namespace {

using ::testing::HasSubstr;

constexpr char kRig[] = LIGHTSTAGE_SOURCE_DIR "/tests/e2e/rigs/small.toml";

struct Result {
  int code;
  std::string out, err;
};

Result RunRender(std::vector<std::string> arguments) {
  std::ostringstream out, err;
  int code = RunApp(arguments, out, err, false);
  return {code, out.str(), err.str()};
}

std::string Path(const std::string& name) {
  return ::testing::TempDir() + "lightstage_render_" + name;
}

double Mean(const std::string& path) {
  auto image = ReadExr(path);
  EXPECT_TRUE(image.ok()) << image.status();
  double sum = 0;
  for (float v : image->pixels()) sum += v;
  return sum / static_cast<double>(image->pixels().size());
}

// A map that is as bright everywhere gives as much light as the same light from lamps all around would.
TEST(RenderApp, LampPatternAndEnvironmentGivePictures) {
  const std::string out = Path("a.exr");
  Result lamp = RunRender({"--rig", kRig, "--lamp", "12", "--spp", "4", "--size", "32x24", "--out",
                           out, "--png", Path("a.png")});
  ASSERT_EQ(lamp.code, 0) << lamp.err;
  EXPECT_THAT(lamp.out, HasSubstr("32×24, 4 samples"));
  EXPECT_GT(Mean(out), 0.01);
  EXPECT_TRUE(std::filesystem::exists(Path("a.png")));

  ASSERT_EQ(
      RunRender({"default", "--rig", kRig, "--pattern", "full", "--spp", "4", "--out", out}).code,
      0);
  const double full = Mean(out);
  ASSERT_EQ(RunRender({"--rig", kRig, "--pattern", "square,grid=2,column=0,row=1", "--spp", "4",
                       "--out", out})
                .code,
            0);
  EXPECT_GT(Mean(out), 0);
  EXPECT_LT(Mean(out), full);

  ASSERT_TRUE(WriteExr(Path("map.exr"), Image(16, 8, 3, 1.0f), ExrPixelType::kFloat).ok());
  ASSERT_EQ(
      RunRender({"--rig", kRig, "--environment", Path("map.exr"), "--spp", "16", "--out", out})
          .code,
      0);
  EXPECT_GT(Mean(out), 0.05);
  EXPECT_LT(Mean(out), 1.0) << "no more than the map";
}

TEST(RenderApp, MistakesAreNamed) {
  const std::string out = Path("x.exr");
  EXPECT_EQ(RunRender({"--rig", kRig, "--out", out}).code, 2);
  EXPECT_EQ(RunRender({"--rig", kRig, "--lamp", "1", "--pattern", "full", "--out", out}).code, 2);
  EXPECT_EQ(RunRender({"--rig", kRig, "--pattern", "stripes", "--out", out}).code, 2);
  EXPECT_EQ(RunRender({"--rig", kRig, "--lamp", "1", "--size", "0x7", "--out", out}).code, 2);
  EXPECT_EQ(RunRender({"atlantis", "--rig", kRig, "--lamp", "1", "--out", out}).code, 2);
  Result lamp = RunRender({"--rig", kRig, "--lamp", "40", "--out", out});
  EXPECT_EQ(lamp.code, 1);
  EXPECT_THAT(lamp.err, HasSubstr("lamp 40 does not exist: this rig has 40 lamps"));
  Result huge = RunRender({"--rig", kRig, "--lamp", "1", "--size", "16384x16384", "--out", out});
  EXPECT_EQ(huge.code, 1);
  EXPECT_THAT(huge.err, HasSubstr("GB"));
  Result rig = RunRender({"--rig", "/nowhere.toml", "--lamp", "1", "--out", out});
  EXPECT_EQ(rig.code, 1);
  EXPECT_THAT(rig.err, HasSubstr("/nowhere.toml"));
}

}  // namespace
}  // namespace lightstage::sim
