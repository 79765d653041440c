#include "dataset/basis_exr.h"

#include <ImathMatrix.h>
#include <ImathVec.h>
#include <ImfInputFile.h>
#include <ImfMatrixAttribute.h>
#include <ImfStandardAttributes.h>

#include <cmath>
#include <limits>

#include "base/status.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace lightstage {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

BasisImage TestBasis(int channels = 3) {
  BasisImage basis;
  basis.pixels = Image(5, 4, channels);
  for (size_t i = 0; i < basis.pixels.pixels().size(); ++i) {
    basis.pixels.pixels()[i] = 0.25f * static_cast<float>(i);
  }
  basis.flags.assign(20, 0);
  return basis;
}

FrameAttributes TestAttributes() {
  FrameAttributes a;
  a.run_id = "20040506-070809";
  a.rig_name = "stage";
  a.shot.id = 123;
  a.shot.kind = ShotKind::kBasis;
  a.shot.pose = {Degrees(5.625), Degrees(30)};
  a.reported_pose = {Degrees(5.6241), Degrees(30.0002)};
  a.shot.condition.lamps = {{7, 1.0}, {9, 0.1}};
  a.shot.condition.pattern = Pattern{.arrangement = PatternArrangement::kVertical,
                                     .profile = PatternProfile::kGaussian,
                                     .grid = 16,
                                     .influence = 2,
                                     .column = 11,
                                     .row = 1};
  a.direction = Vec3(0.6, 0, 0.8);
  a.exposures_s = {0.0005, 0.004};
  a.captured_at = "2004-05-06T07:08:09.123456Z";
  return a;
}

TEST(BasisExrTest, ImageAndAttributesComeBack) {
  for (int channels : {1, 3}) {
    BasisImage basis = TestBasis(channels);
    FrameAttributes a = TestAttributes();
    auto bytes = EncodeBasisExr(basis, a, ExrCompression::kPiz);
    ASSERT_TRUE(bytes.ok()) << bytes.status();
    auto decoded = DecodeBasisExr(*bytes, "basis");
    ASSERT_TRUE(decoded.ok()) << decoded.status();
    ASSERT_TRUE(decoded->image.pixels.SameShape(basis.pixels));
    EXPECT_TRUE(std::equal(basis.pixels.pixels().begin(), basis.pixels.pixels().end(),
                           decoded->image.pixels.pixels().begin()));
    EXPECT_THAT(decoded->image.flags, Each(0));
    const FrameAttributes& d = decoded->attributes;
    EXPECT_EQ(d.run_id, a.run_id);
    EXPECT_EQ(d.rig_name, a.rig_name);
    EXPECT_EQ(d.shot.id, 123u);
    EXPECT_EQ(d.shot.kind, ShotKind::kBasis);
    EXPECT_EQ(d.shot.pose, a.shot.pose);
    EXPECT_EQ(d.reported_pose, a.reported_pose);
    EXPECT_EQ(d.shot.condition, a.shot.condition);
    EXPECT_EQ(d.direction, a.direction);
    EXPECT_EQ(d.captured_at, a.captured_at);
    EXPECT_THAT(d.exposures_s, ElementsAre(double{0.0005f}, double{0.004f}));
  }
}

TEST(BasisExrTest, DarkShotsHaveNoDirection) {
  FrameAttributes a = TestAttributes();
  a.shot.kind = ShotKind::kDark;
  a.shot.condition = {};
  a.direction.reset();
  DecodedBasis decoded =
      DecodeBasisExr(EncodeBasisExr(TestBasis(), a, ExrCompression::kNone).value(), "dark").value();
  EXPECT_EQ(decoded.attributes.shot.kind, ShotKind::kDark);
  EXPECT_FALSE(decoded.attributes.direction.has_value());
  EXPECT_EQ(decoded.attributes.shot.condition, Condition{});
}

TEST(BasisExrTest, FlagsAreExactUnderEveryCompression) {
  BasisImage basis;
  basis.pixels = Image(64, 64, 3);
  basis.flags.resize(64 * 64);
  for (size_t i = 0; i < basis.flags.size(); ++i) {
    basis.flags[i] = static_cast<uint8_t>(i * 7 % 4);
    basis.pixels.pixels()[3 * i] = static_cast<float>(i % 100);
  }
  for (const std::string& name : ExrCompressionNames()) {
    auto bytes = EncodeBasisExr(basis, TestAttributes(), ParseExrCompression(name).value());
    EXPECT_EQ(DecodeBasisExr(*bytes, name)->image.flags, basis.flags) << name;
  }
}

TEST(BasisExrTest, WhatAHalfCannotHoldIsALowerBoundAndMarkedAsOne) {
  BasisImage basis = TestBasis();
  basis.pixels.at(2, 1, 1) = 70000.0f;
  basis.flags[0] = kBelowRange;
  DecodedBasis decoded =
      DecodeBasisExr(EncodeBasisExr(basis, TestAttributes(), ExrCompression::kPiz).value(), "b")
          .value();
  EXPECT_EQ(decoded.image.pixels.at(2, 1, 1), 65504.0f);
  EXPECT_EQ(decoded.image.flags[1 * 5 + 2], kAboveRange);
  EXPECT_EQ(decoded.image.flags[0], kBelowRange);
}

TEST(BasisExrTest, RefusesWhatNoBasisImageIs) {
  BasisImage nan = TestBasis();
  nan.pixels.at(0, 0, 0) = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(ErrorReason(EncodeBasisExr(nan, TestAttributes(), ExrCompression::kPiz).status()),
            "IMAGE_INVALID");
  BasisImage flags = TestBasis();
  flags.flags.pop_back();
  EXPECT_EQ(ErrorReason(EncodeBasisExr(flags, TestAttributes(), ExrCompression::kPiz).status()),
            "IMAGE_INVALID");
  EXPECT_EQ(ErrorReason(EncodeBasisExr({}, TestAttributes(), ExrCompression::kPiz).status()),
            "IMAGE_INVALID");
}

TEST(BasisExrTest, HeaderAlone) {
  std::string bytes = EncodeBasisExr(TestBasis(1), TestAttributes(), ExrCompression::kZip).value();
  BasisHeader header = ReadBasisHeader(bytes, "b").value();
  EXPECT_EQ(header.width, 5);
  EXPECT_EQ(header.height, 4);
  EXPECT_EQ(header.channels, 1);
  EXPECT_EQ(header.attributes.shot.id, 123u);
}

TEST(BasisExrTest, APlainPictureIsNoBasisImage) {
  std::string bytes = EncodeExr(Image(4, 4, 3), ExrPixelType::kHalf).value();
  absl::Status status = DecodeBasisExr(bytes, "env.exr").status();
  EXPECT_EQ(ErrorReason(status), "EXR_UNSUPPORTED");
  EXPECT_THAT(std::string(status.message()), HasSubstr("env.exr"));
}

TEST(BasisExrTest, TruncationIsDataLoss) {
  std::string bytes = EncodeBasisExr(TestBasis(), TestAttributes(), ExrCompression::kPiz).value();
  for (size_t size = 0; size < bytes.size(); size += 7) {
    EXPECT_EQ(DecodeBasisExr(bytes.substr(0, size), "cut").status().code(),
              absl::StatusCode::kDataLoss);
  }
}

// What any EXR reader sees, through OpenEXR itself.
TEST(BasisExrTest, StandardAttributes) {
  FrameAttributes a = TestAttributes();
  // On +X at 2 m, looking at the origin: right is +Y, up is +Z.
  a.camera = CameraGeometry{
      .position = Vec3(2, 0, 0), .look_at = Vec3(0, 0, 0), .field_of_view = Degrees(30)};
  std::string path = ::testing::TempDir() + "lightstage_basis_exr_test.exr";
  ASSERT_TRUE(PosixEnv()
                  .WriteFile(path, EncodeBasisExr(TestBasis(), a, ExrCompression::kPiz).value())
                  .ok());
  {
    Imf::InputFile file(path.c_str());
    const Imf::Header& header = file.header();
    EXPECT_EQ(Imf::capDate(header), "2004:05:06 07:08:09");
    EXPECT_EQ(Imf::utcOffset(header), 0.0f);
    EXPECT_EQ(Imf::expTime(header), 0.004f);
    EXPECT_THAT(Imf::comments(header), HasSubstr("shot 123 (basis)"));
    Imath::M44f m = Imf::worldToCamera(header);
    auto camera_space = [&](float x, float y, float z) { return Imath::V3f(x, y, z) * m; };
    EXPECT_TRUE(camera_space(2, 0, 0).equalWithAbsError(Imath::V3f(0, 0, 0), 1e-6f));
    EXPECT_TRUE(camera_space(0, 0, 0).equalWithAbsError(Imath::V3f(0, 0, -2), 1e-6f));
    EXPECT_TRUE(camera_space(0, 1, 0).equalWithAbsError(Imath::V3f(1, 0, -2), 1e-6f));
    EXPECT_TRUE(camera_space(0, 0, 1).equalWithAbsError(Imath::V3f(0, 1, -2), 1e-6f));
  }
  EXPECT_TRUE(PosixEnv().Remove(path).ok());
}

}  // namespace
}  // namespace lightstage
