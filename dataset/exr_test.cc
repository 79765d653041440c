#include "dataset/exr.h"

#include <cmath>
#include <filesystem>
#include <limits>
#include <new>
#include <random>

#include "base/status.h"
#include "dataset/exr_codec.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace lightstage {
namespace {

using ::testing::HasSubstr;

// Exactly representable as half, so that lossless means equal.
Image TestImage(int width, int height, int channels) {
  Image image(width, height, channels);
  std::mt19937 random(7);
  for (float& v : image.pixels()) v = static_cast<float>(random() % 2048) * 0.125f;
  return image;
}

bool Equal(const Image& a, const Image& b) {
  return a.SameShape(b) && std::equal(a.pixels().begin(), a.pixels().end(), b.pixels().begin());
}

TEST(ExrTest, CompressionNames) {
  for (const std::string& name : ExrCompressionNames()) {
    EXPECT_EQ(ExrCompressionName(ParseExrCompression(name).value()), name);
  }
  absl::Status status = ParseExrCompression("lzw").status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(status.message()), HasSubstr("none, rle, zips, zip, piz, dwaa"));
}

TEST(ExrTest, EveryCompressionTypeAndShapeComesBack) {
  for (const std::string& name : ExrCompressionNames()) {
    ExrCompression compression = ParseExrCompression(name).value();
    for (ExrPixelType type : {ExrPixelType::kHalf, ExrPixelType::kFloat}) {
      for (int channels : {1, 3}) {
        SCOPED_TRACE(name + (type == ExrPixelType::kHalf ? " half " : " float ") +
                     std::to_string(channels));
        Image image = TestImage(37, 21, channels);
        auto bytes = EncodeExr(image, type, compression);
        ASSERT_TRUE(bytes.ok()) << bytes.status();
        auto decoded = DecodeExr(*bytes, "picture");
        ASSERT_TRUE(decoded.ok()) << decoded.status();
        ASSERT_TRUE(decoded->SameShape(image));
        EXPECT_TRUE(compression == ExrCompression::kDwaa || Equal(*decoded, image));
      }
    }
  }
}

TEST(ExrTest, HalfRoundsToNearestAndClamps) {
  Image image(3, 1, 1);
  image.at(0, 0, 0) = 1.0f / 3.0f;
  image.at(1, 0, 0) = 1e6f;
  image.at(2, 0, 0) = -1e6f;
  Image decoded = DecodeExr(EncodeExr(image, ExrPixelType::kHalf).value(), "picture").value();
  EXPECT_EQ(decoded.at(0, 0, 0), 1365.0f / 4096.0f);  // the half next to ⅓: 11 bits of mantissa
  EXPECT_EQ(decoded.at(1, 0, 0), 65504.0f);
  EXPECT_EQ(decoded.at(2, 0, 0), -65504.0f);
}

// Every finite half is itself, and what lies half-way between two goes to the even one.
TEST(ExrTest, AllHalves) {
  constexpr int kFinite = 0x7c00;  // halves from 0 up to the largest
  Image image(kFinite, 2, 1);
  std::vector<float> values;
  for (int i = 0; i < kFinite; ++i) {
    int exponent = i >> 10, mantissa = i & 0x3ff;
    values.push_back(exponent == 0
                         ? std::ldexp(static_cast<float>(mantissa), -24)
                         : std::ldexp(static_cast<float>(mantissa + 1024), exponent - 25));
  }
  for (int i = 0; i < kFinite; ++i) {
    image.at(i, 0, 0) = values[i];
    image.at(i, 1, 0) = i + 1 < kFinite ? -0.5f * (values[i] + values[i + 1]) : 0.0f;
  }
  Image decoded = DecodeExr(EncodeExr(image, ExrPixelType::kHalf).value(), "picture").value();
  for (int i = 0; i + 1 < kFinite; ++i) {
    ASSERT_EQ(decoded.at(i, 0, 0), values[i]) << i;
    ASSERT_EQ(decoded.at(i, 1, 0), -values[i + i % 2]) << i;
  }
}

TEST(ExrTest, RefusesWhatNoPictureIs) {
  Image image(2, 2, 3);
  for (float bad :
       {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
    image.at(1, 1, 2) = bad;
    EXPECT_EQ(ErrorReason(EncodeExr(image, ExrPixelType::kHalf).status()), "IMAGE_INVALID");
    EXPECT_EQ(ErrorReason(EncodeExr(image, ExrPixelType::kFloat).status()), "IMAGE_INVALID");
  }
  EXPECT_EQ(ErrorReason(EncodeExr(Image(), ExrPixelType::kHalf).status()), "IMAGE_INVALID");
  EXPECT_EQ(ErrorReason(EncodeExr(Image(2, 2, 2), ExrPixelType::kHalf).status()), "IMAGE_INVALID");
}

TEST(ExrTest, FilesComeBackAndErrorsNameThem) {
  std::string path = ::testing::TempDir() + "lightstage_exr_test.exr";
  Image image = TestImage(16, 16, 3);
  ASSERT_TRUE(WriteExr(path, image, ExrPixelType::kFloat).ok());
  EXPECT_TRUE(Equal(ReadExr(path).value(), image));
  ASSERT_TRUE(PosixEnv().Truncate(path, 200).ok());
  absl::Status status = ReadExr(path).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kDataLoss);
  EXPECT_EQ(ErrorReason(status), "EXR_CORRUPT");
  EXPECT_THAT(std::string(status.message()), HasSubstr(path));
  ASSERT_TRUE(PosixEnv().Remove(path).ok());
  EXPECT_EQ(ReadExr(path).status().code(), absl::StatusCode::kNotFound);
}

TEST(ExrTest, LargerFilesThanInputsAreRefusedUnread) {
  const std::string path = ::testing::TempDir() + "lightstage_exr_huge.exr";
  ASSERT_TRUE(WriteExr(path, TestImage(16, 16, 3), ExrPixelType::kFloat).ok());
  std::filesystem::resize_file(path, kLargestInput + 1);
  const absl::Status status = ReadExr(path).status();
  EXPECT_EQ(ErrorReason(status), "FILE_TOO_LARGE") << status;
  std::filesystem::remove(path);
}

TEST(ExrTest, WantOfMemoryIsNoDamage) {
  const std::string bytes = EncodeExr(TestImage(16, 16, 3), ExrPixelType::kFloat).value();
  const absl::Status status = exr_codec::Read(
      bytes, "fine.exr", [](Imf::InputFile&) -> absl::Status { throw std::bad_alloc(); });
  EXPECT_EQ(ErrorReason(status), "MEMORY") << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("fine.exr"));
}

TEST(ExrTest, EveryTruncationIsDataLoss) {
  std::string bytes = EncodeExr(TestImage(12, 40, 3), ExrPixelType::kHalf).value();
  for (size_t size = 0; size < bytes.size(); size += 37) {
    auto decoded = DecodeExr(std::string_view(bytes).substr(0, size), "cut");
    EXPECT_EQ(decoded.status().code(), absl::StatusCode::kDataLoss) << size;
  }
}

// Whatever is wrong with a file, reading it ends with a status. (That a flipped bit is found at all is the checksum's task.)
TEST(ExrTest, FlippedBytesNeverCrash) {
  for (const std::string& name : ExrCompressionNames()) {
    std::string bytes =
        EncodeExr(TestImage(24, 40, 3), ExrPixelType::kHalf, ParseExrCompression(name).value())
            .value();
    std::mt19937 random(1);
    for (int i = 0; i < 40; ++i) {
      std::string damaged = bytes;
      // The first 400 bytes are the header: half of the damage goes there.
      size_t range = i % 2 == 0 ? 400 : damaged.size();
      for (int k = 0; k < 1 + i % 3; ++k) damaged[random() % range] = static_cast<char>(random());
      auto decoded = DecodeExr(damaged, "damaged");
      EXPECT_EQ(decoded.ok(), decoded.status().message().empty());
    }
  }
}

TEST(ExrTest, AbsurdSizesAreRefusedWithoutAllocating) {
  std::string bytes = EncodeExr(TestImage(8, 8, 1), ExrPixelType::kHalf).value();
  // Both windows are four int32: 0, 0, 7, 7.
  const std::string window("\0\0\0\0\0\0\0\0\7\0\0\0\7\0\0\0", 16);
  const std::string huge("\0\0\0\0\0\0\0\0\xff\xff\xff\x3f\xff\xff\xff\x3f", 16);
  for (size_t at = bytes.find(window); at != std::string::npos; at = bytes.find(window)) {
    bytes.replace(at, 16, huge);
  }
  EXPECT_EQ(DecodeExr(bytes, "huge").status().code(), absl::StatusCode::kDataLoss);
}

TEST(ExrTest, WhatIsNoExrIsDataLoss) {
  for (std::string_view bytes :
       {"", "x", "not an EXR file at all, but long enough to be read as one"}) {
    EXPECT_EQ(DecodeExr(bytes, "text").status().code(), absl::StatusCode::kDataLoss);
  }
}

}  // namespace
}  // namespace lightstage
