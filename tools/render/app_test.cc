#include "tools/render/app.h"

#include <sys/resource.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
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

TEST(RenderApp, IncidentLightFieldComesFromAFolder) {
  const std::filesystem::path folder = Path("field");
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder);
  auto index = [&](const std::string& text) { std::ofstream(folder / "light_field.toml") << text; };
  const std::string good =
      "columns = 2\nrows = 1\norigin_m = [-0.2, 0, 0.1]\nu_m = [0.4, 0, 0]\nv_m = [0, 1, 0]\n";
  index(good);
  const std::string out = Path("field.exr");
  auto render = [&] {
    return RunRender({"--rig", kRig, "--incident-light-field", folder.string(), "--spp", "4",
                      "--bounces", "0", "--size", "32x24", "--out", out});
  };
  EXPECT_THAT(render().err, HasSubstr("0-0.exr"));
  ASSERT_TRUE(
      WriteExr((folder / "0-0.exr").string(), Image(8, 4, 3, 0.0f), ExrPixelType::kFloat).ok());
  ASSERT_TRUE(
      WriteExr((folder / "0-1.exr").string(), Image(8, 4, 3, 0.0f), ExrPixelType::kFloat).ok());
  EXPECT_THAT(render().err, HasSubstr("black"));
  ASSERT_TRUE(
      WriteExr((folder / "0-1.exr").string(), Image(16, 8, 3, 1.0f), ExrPixelType::kFloat).ok());
  EXPECT_THAT(render().err, HasSubstr("0-1.exr: is 16 x 8 pixels, must be 8 x 4"));
  ASSERT_TRUE(
      WriteExr((folder / "0-1.exr").string(), Image(8, 4, 3, 1.0f), ExrPixelType::kFloat).ok());
  Result done = render();
  ASSERT_EQ(done.code, 0) << done.err;
  // It is brighter on the right.
  auto image = ReadExr(out);
  ASSERT_TRUE(image.ok());
  double left = 0, right = 0;
  for (int y = 0; y < 24; ++y) {
    for (int x = 0; x < 10; ++x) left += image->at(x, y, 1), right += image->at(31 - x, y, 1);
  }
  EXPECT_GT(right, 1.5 * left);
  index(good + "w = 3\n");
  EXPECT_THAT(render().err, HasSubstr("light_field.toml:6"));
  index("columns = 2\nrows = 1\norigin_m = [0, 0, 0]\nu_m = [0.4, 0, 0]\nv_m = [1, 0, 0]\n");
  EXPECT_THAT(render().err, HasSubstr("parallel"));
}

TEST(RenderApp, NumbersThatAreNoneAndFilesThatAreOneAreRefused) {
  const std::string out = Path("never.exr");
  EXPECT_EQ(RunRender({"--rig", kRig, "--lamp", "1", "--azimuth", "nan", "--out", out}).code, 2);
  EXPECT_EQ(RunRender({"--rig", kRig, "--lamp", "1", "--size", "4294967297x8", "--out", out}).code,
            2);
  EXPECT_EQ(RunRender({"--rig", kRig, "--lamp", "1", "--size", " 8x8", "--out", out}).code, 2);
  EXPECT_EQ(RunRender({"--rig", kRig, "--pattern", "", "--out", out}).code, 2);
  EXPECT_EQ(RunRender({"--rig", kRig, "--lamp", "1", "--out", out, "--png", out}).code, 2);
  EXPECT_THAT(RunRender({"--rig", kRig, "--lamp", "1", "--out", "/nowhere/at/all.exr"}).err,
              HasSubstr("no folder /nowhere/at"));
  EXPECT_FALSE(std::filesystem::exists(out));
  // Found before anything is rendered.
  const std::string loop = Path("loop"), longest(300, 'x');
  std::filesystem::remove(loop);
  std::filesystem::create_symlink(loop, loop);
  for (const std::string& bad : {std::string("/dev/full"), std::string("/"), loop, longest}) {
    const Result result =
        RunRender({"--rig", kRig, "--lamp", "1", "--spp", "1000000", "--out", bad});
    EXPECT_NE(result.code, 0) << bad;
    EXPECT_THAT(result.err, HasSubstr(bad));
    EXPECT_THAT(RunRender({"--rig", kRig, "--environment", bad, "--out", out}).err, HasSubstr(bad));
  }
}

TEST(RenderApp, WhatIsReadIsNotReplaced) {
  const std::filesystem::path folder = Path("inputs");
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder / "field");
  auto in = [&](const char* name) { return (folder / name).string(); };
  std::ofstream(in("scene.toml")) << "[[ball]]\nradius_m = 0.05\nmaterial = \"m\"\n"
                                     "[material.m]\ndiffuse = [1, 1, 1]\n";
  std::filesystem::copy_file(kRig, in("rig.toml"));
  std::ofstream(in("field/light_field.toml"))
      << "columns = 1\nrows = 1\norigin_m = [0, 0, 0]\nu_m = [1, 0, 0]\nv_m = [0, 1, 0]\n";
  for (const char* map : {"map.exr", "field/0-0.exr"}) {
    ASSERT_TRUE(WriteExr(in(map), Image(8, 4, 3, 1.0f), ExrPixelType::kFloat).ok());
  }
  std::filesystem::create_symlink("scene.toml", in("link.exr"));
  const auto refused = [&](const std::string& option, const char* input,
                           const std::vector<std::string>& light) {
    std::vector<std::string> arguments = {in("scene.toml"), "--rig", in("rig.toml"), "--spp",
                                          "1000000"};
    if (option == "--png") arguments.insert(arguments.end(), {"--out", in("new.exr")});
    arguments.insert(arguments.end(), {option, in(input)});
    arguments.insert(arguments.end(), light.begin(), light.end());
    const Result result = RunRender(arguments);
    EXPECT_EQ(result.code, 2) << input;
    EXPECT_THAT(result.err, HasSubstr(option + " would replace ")) << input;
  };
  for (const char* option : {"--out", "--png"}) {
    for (const char* input : {"scene.toml", "rig.toml", "link.exr"})
      refused(option, input, {"--lamp", "1"});
    refused(option, "map.exr", {"--environment", in("map.exr")});
    for (const char* input : {"field/0-0.exr", "field/light_field.toml"})
      refused(option, input, {"--incident-light-field", in("field")});
  }
}

TEST(RenderApp, MapsBrighterThanAPictureCanHoldAreRefused) {
  const std::filesystem::path folder = Path("bright");
  std::filesystem::create_directories(folder);
  const std::string map = (folder / "0-0.exr").string(), out = Path("bright.exr");
  Image image(8, 4, 3, 1.0f);
  image.at(5, 2, 1) = 3.4e38f;
  ASSERT_TRUE(WriteExr(map, image, ExrPixelType::kFloat).ok());
  std::ofstream(folder / "light_field.toml")
      << "columns = 1\nrows = 1\norigin_m = [0, 0, 0]\nu_m = [1, 0, 0]\nv_m = [0, 1, 0]\n";
  for (const std::vector<std::string>& light :
       {std::vector<std::string>{"--environment", map},
        std::vector<std::string>{"--incident-light-field", folder.string()}}) {
    std::vector<std::string> arguments = {"--rig",  kRig,  "--spp", "1",
                                          "--size", "8x8", "--out", out};
    arguments.insert(arguments.end(), light.begin(), light.end());
    const Result result = RunRender(arguments);
    EXPECT_EQ(result.code, 1);
    EXPECT_THAT(result.err, HasSubstr(map + ": pixel (5, 2) is 3.4e+38"));
  }
  image.at(5, 2, 1) = 1e30f;
  ASSERT_TRUE(WriteExr(map, image, ExrPixelType::kFloat).ok());
  const Result result =
      RunRender({"--rig", kRig, "--environment", map, "--spp", "4", "--size", "8x8", "--out", out});
  EXPECT_EQ(result.code, 0) << result.err;
}

#ifndef LIGHTSTAGE_SANITIZED
// In processes of their own, with so much more memory than they have taken already.
TEST(RenderAppDeathTest, WantOfMemoryOrThreadsIsSaid) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  auto render = [](rlim_t more) {
    long pages = 0;
    std::ifstream("/proc/self/statm") >> pages;
    const rlim_t most =
        static_cast<rlim_t>(pages) * static_cast<rlim_t>(::sysconf(_SC_PAGESIZE)) + more;
    const rlimit space{most, most};
    ::setrlimit(RLIMIT_AS, &space);
    const Result result = RunRender({"--rig", kRig, "--lamp", "12", "--spp", "1", "--size", "64x48",
                                     "--out", Path("short.exr")});
    ::_exit(result.code == (result.err.empty() ? 0 : 1) ? 7 : 1);
  };
  for (rlim_t megabytes : {1, 10, 30, 60, 120}) {
    EXPECT_EXIT(render(megabytes << 20), testing::ExitedWithCode(7), "") << megabytes;
  }
}
#endif

}  // namespace
}  // namespace lightstage::sim
