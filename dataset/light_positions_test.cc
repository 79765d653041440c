#include "dataset/light_positions.h"

#include "base/status.h"
#include "dataset/test_record.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace lightstage {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

// On −Y, at the height of the object: right is +X, up is +Z, and the camera is toward −Y.
CameraGeometry FrontCamera() { return {.position = Vec3(0, -2, 0), .look_at = Vec3(0, 0, 0)}; }

ShotRecord Lit(uint64_t id, const Vec3& direction) {
  ShotRecord record = TestRecord(id);
  record.direction = direction;
  record.file =
      "basis/" + std::string(6 - std::to_string(id).size(), '0') + std::to_string(id) + ".exr";
  return record;
}

TEST(LightPositionsTest, AxesAreRightUpAndTowardTheCamera) {
  CameraGeometry camera = FrontCamera();
  EXPECT_TRUE(ToCameraAxes(Vec3(1, 0, 0), camera).isApprox(Vec3(1, 0, 0)));
  EXPECT_TRUE(ToCameraAxes(Vec3(0, 0, 1), camera).isApprox(Vec3(0, 1, 0)));
  EXPECT_TRUE(ToCameraAxes(Vec3(0, -1, 0), camera).isApprox(Vec3(0, 0, 1)));
  // Seen from 45° above, a light in the zenith is half-way between up and toward the camera.
  camera.position = Vec3(0, -2, 2);
  double h = std::sqrt(0.5);
  EXPECT_TRUE(ToCameraAxes(Vec3(0, 0, 1), camera).isApprox(Vec3(0, h, h)));
}

TEST(LightPositionsTest, TextIsWhatReadersAccept) {
  std::vector<std::string> files =
      WriteLightPositions({Lit(0, Vec3(1, 0, 0)), Lit(1, Vec3(0, -0.6, 0.8))}, FrontCamera());
  ASSERT_THAT(files, SizeIs(1));
  EXPECT_EQ(files[0],
            "2\n"
            "basis/000000.exr 1.00000000 0.00000000 0.00000000\n"
            "basis/000001.exr 0.00000000 0.80000000 0.60000000\n");
}

TEST(LightPositionsTest, OnlyBasisImagesWithADirection) {
  ShotRecord dark = Lit(1, Vec3(1, 0, 0)), everything = Lit(2, Vec3(1, 0, 0));
  dark.shot.kind = ShotKind::kDark;
  everything.direction.reset();
  EXPECT_THAT(WriteLightPositions({dark, everything}, FrontCamera()), IsEmpty());
}

TEST(LightPositionsTest, AtMostAThousandPerFile) {
  std::vector<ShotRecord> shots;
  for (uint64_t id = 0; id < 2001; ++id) shots.push_back(Lit(id, Vec3(0, 0, 1)));
  std::vector<std::string> files = WriteLightPositions(shots, FrontCamera());
  ASSERT_THAT(files, SizeIs(3));
  auto first = ParseLightPositions(files[0], "a").value();
  auto last = ParseLightPositions(files[2], "c").value();
  EXPECT_THAT(first, SizeIs(1000));
  ASSERT_THAT(last, SizeIs(1));
  EXPECT_EQ(last[0].file, "basis/002000.exr");
  EXPECT_TRUE(last[0].direction.isApprox(Vec3(0, 1, 0)));
  EXPECT_EQ(LightFileName(2), "lights_002.lp");
}

TEST(LightPositionsTest, ErrorsNameTheLine) {
  auto message = [](std::string_view text) {
    absl::Status status = ParseLightPositions(text, "lights_000.lp").status();
    EXPECT_EQ(status.code(), absl::StatusCode::kDataLoss);
    return std::string(status.message());
  };
  EXPECT_THAT(message(""), HasSubstr("lights_000.lp:1:"));
  EXPECT_THAT(message("2\na 0 0 1\n"), HasSubstr("lights_000.lp:1: says 2 lights, but 1 follow"));
  EXPECT_THAT(message("1\na 0 0 up\n"), HasSubstr("lights_000.lp:2:"));
  EXPECT_THAT(message("1\na 0 0 1 \n"), HasSubstr("lights_000.lp:2:"));
}

}  // namespace
}  // namespace lightstage
