#include "relight/cli/app.h"

#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>

#include "dataset/exr.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "relight/test_dataset.h"

namespace lightstage::relight {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

struct Result {
  int code;
  std::string out, err;
};

Result RunRelight(const std::vector<std::string>& arguments) {
  std::ostringstream out, err;
  int code = RunApp(arguments, out, err);
  return {code, out.str(), err.str()};
}

TEST(RelightApp, FromADatasetToPictures) {
  const std::string folder = TestFolder();
  WriteSphere(folder, StageDirections(16, 6), {1, 0.5f, 0.25f});
  const std::string map = folder + "/map.exr", out = folder + "/relit.exr";
  Result made = RunRelight({"make-environment", "--out", map, "--width", "64"});
  ASSERT_EQ(made.code, 0) << made.err;

  Result relit = RunRelight({"env", folder, "--environment", map, "--out", out, "--png",
                             folder + "/relit.png", "--rotate", "-30", "--format", "json"});
  ASSERT_EQ(relit.code, 0) << relit.err;
  EXPECT_THAT(relit.err, IsEmpty());
  auto json = nlohmann::json::parse(relit.out);  // one object, nothing else
  EXPECT_EQ(json["images"], 96);
  EXPECT_EQ(json["coverage"], "upperHemisphere");
  EXPECT_GT(json["leftOutShare"], 0.01);
  EXPECT_LT(json["leftOutShare"], 0.5);
  auto image = ReadExr(out);
  ASSERT_TRUE(image.ok()) << image.status();
  EXPECT_EQ(image->width(), kSphereSize);
  EXPECT_EQ(image->channels(), 3);
  EXPECT_GT(image->at(16, 8, 0), 0);
  EXPECT_TRUE(std::filesystem::exists(folder + "/relit.png"));

  Result sheet = RunRelight({"contact-sheet", folder, "--out", folder + "/sheet.png"});
  ASSERT_EQ(sheet.code, 0) << sheet.err;
  EXPECT_THAT(sheet.out, HasSubstr("16×6, 96 of 96"));
  EXPECT_TRUE(std::filesystem::exists(folder + "/sheet.png"));
}

TEST(RelightApp, WarnsWhereTheCaptureDoesNotReach) {
  const std::string folder = TestFolder();
  WriteSphere(folder, {Vec3::UnitX(), Vec3::UnitZ()}, {1});
  const std::string map = folder + "/map.exr";
  ASSERT_EQ(RunRelight({"make-environment", "studio", "--out", map, "--width", "32"}).code, 0);
  Result relit = RunRelight({"env", folder, "--environment", map, "--out", folder + "/relit.exr"});
  EXPECT_EQ(relit.code, 0);
  EXPECT_THAT(relit.err, HasSubstr("from the nearest lamp"));
  EXPECT_THAT(relit.out, HasSubstr("below the horizon"));
}

TEST(RelightApp, FailuresAreOneAndNameTheFile) {
  const std::string folder = TestFolder();
  const std::string out = folder + "/x.exr", map = folder + "/map.exr";
  Result no_map =
      RunRelight({"env", folder, "--environment", map, "--out", out, "--format", "json"});
  EXPECT_EQ(no_map.code, 1);
  EXPECT_THAT(no_map.out, IsEmpty());
  EXPECT_THAT(no_map.err, HasSubstr("map.exr"));
  ASSERT_EQ(RunRelight({"make-environment", "--out", map, "--width", "32"}).code, 0);
  Result no_dataset = RunRelight({"env", folder, "--environment", map, "--out", out});
  EXPECT_EQ(no_dataset.code, 1);
  EXPECT_THAT(no_dataset.err, HasSubstr("manifest.json"));
  EXPECT_FALSE(std::filesystem::exists(out));
  Result no_folder = RunRelight({"make-environment", "--out", folder + "/none/map.exr"});
  EXPECT_EQ(no_folder.code, 1);
  EXPECT_THAT(no_folder.err, HasSubstr("none/map.exr"));
}

TEST(RelightApp, WrongUsageIsTwo) {
  EXPECT_EQ(RunRelight({}).code, 2);
  EXPECT_EQ(RunRelight({"polish"}).code, 2);
  EXPECT_EQ(RunRelight({"env", "somewhere"}).code, 2);
  EXPECT_EQ(RunRelight({"env", "a", "--environment", "b", "--out", "c", "--rotate", "north"}).code,
            2);
  EXPECT_EQ(RunRelight({"env", "a", "--environment", "b", "--out", "c", "--rotate", "nan"}).code,
            2);
  EXPECT_EQ(RunRelight({"make-environment", "--out", "x", "--width", "7"}).code, 2);
  EXPECT_EQ(RunRelight({"make-environment", "beach", "--out", "x"}).code, 2);
  EXPECT_EQ(RunRelight({"--format", "xml", "make-environment", "--out", "x"}).code, 2);
  Result help = RunRelight({"--help"});
  EXPECT_EQ(help.code, 0);
  EXPECT_THAT(help.out, HasSubstr("contact-sheet"));
}

}  // namespace
}  // namespace lightstage::relight
