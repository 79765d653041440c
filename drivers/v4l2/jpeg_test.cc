// Pictures that libjpeg-turbo's encoder makes here, decoded; alone, and on their whole way through the driver.
#include "drivers/v4l2/jpeg.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/videodev2.h>
#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>
#include <turbojpeg.h>

#include <cmath>
#include <functional>
#include <sstream>

#include "absl/strings/str_cat.h"
#include "base/status.h"
#include "drivers/v4l2/fake_system.h"
#include "drivers/v4l2/photographer.h"
#include "drivers/v4l2/v4l2_camera.h"

namespace lightstage {
namespace {

using std::chrono::milliseconds;
using testing::HasSubstr;

using Sample = std::function<unsigned(int x, int y, int c)>;

std::vector<uint8_t> Encode(int width, int height, const Sample& sample,
                            TJSAMP subsampling = TJSAMP_422, int flags = 0) {
  std::vector<uint8_t> rgb;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int c = 0; c < 3; ++c) rgb.push_back(static_cast<uint8_t>(sample(x, y, c)));
    }
  }
  tjhandle encoder = tjInitCompress();
  unsigned char* out = nullptr;
  unsigned long size = 0;
  EXPECT_EQ(tjCompress2(encoder, rgb.data(), width, 0, height, TJPF_RGB, &out, &size, subsampling,
                        95, flags | TJFLAG_ACCURATEDCT),
            0);
  std::vector<uint8_t> jpeg(out, out + size);
  tjFree(out);
  tjDestroy(encoder);
  return jpeg;
}

// Smooth in all channels, as a lens would make it.
unsigned Smooth(int x, int y, int c) {
  return static_cast<unsigned>(128 + 100 * std::sin(x * 0.11 + c) * std::cos(y * 0.07));
}

absl::StatusOr<std::vector<std::byte>> Decode(const std::vector<uint8_t>& jpeg, int width,
                                              int height, PixelFormat format) {
  // Heap memory of just that length, so that a sanitizer sees a byte too many.
  const std::vector<uint8_t> exact(jpeg);
  return DecodeJpeg(std::as_bytes(std::span(exact)), width, height, format);
}

void ExpectIncomplete(const std::vector<uint8_t>& jpeg, int width, int height,
                      const std::string& part = "") {
  for (PixelFormat format : {PixelFormat::kMono8, PixelFormat::kRGB8}) {
    const absl::Status status = Decode(jpeg, width, height, format).status();
    EXPECT_EQ(ErrorReason(status), "FRAME_INCOMPLETE") << status;
    EXPECT_TRUE(absl::IsDataLoss(status)) << status;
    EXPECT_THAT(MessageOf(status), HasSubstr(part));
  }
}

TEST(Jpeg, PicturesComeThroughAsGoodAsTheEncoderLeftThem) {
  for (const auto& [width, height] : std::vector<std::pair<int, int>>{{64, 48}, {61, 35}, {1, 1}}) {
    for (TJSAMP subsampling : {TJSAMP_444, TJSAMP_422, TJSAMP_420}) {
      const std::vector<uint8_t> jpeg = Encode(width, height, Smooth, subsampling);
      const auto rgb = Decode(jpeg, width, height, PixelFormat::kRGB8);
      const auto luma = Decode(jpeg, width, height, PixelFormat::kMono8);
      ASSERT_TRUE(rgb.ok()) << rgb.status();
      ASSERT_TRUE(luma.ok()) << luma.status();
      ASSERT_EQ(rgb->size(), static_cast<size_t>(width) * height * 3);
      ASSERT_EQ(luma->size(), static_cast<size_t>(width) * height);
      int worst = 0, worst_luma = 0;
      for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
          const int at = y * width + x;
          double expected = 0;  // JFIF's luma
          for (int c = 0; c < 3; ++c) {
            const int value = static_cast<int>(Smooth(x, y, c));
            worst = std::max(worst, std::abs(static_cast<int>((*rgb)[at * 3 + c]) - value));
            expected += (c == 0 ? 0.299 : c == 1 ? 0.587 : 0.114) * value;
          }
          worst_luma = std::max(worst_luma, std::abs(static_cast<int>((*luma)[at]) -
                                                     static_cast<int>(std::lround(expected))));
        }
      }
      // Less colour is kept than there is, and none at the edges.
      EXPECT_LE(worst, subsampling == TJSAMP_444 ? 5 : 24) << width << " " << subsampling;
      EXPECT_LE(worst_luma, 4) << width << " " << subsampling;
    }
  }
}

TEST(Jpeg, GreyPicturesHaveAllChannelsAlike) {
  const auto grey = [](int x, int y, int) { return Smooth(x, y, 0); };
  const std::vector<uint8_t> jpeg = Encode(32, 24, grey, TJSAMP_GRAY);
  const auto rgb = Decode(jpeg, 32, 24, PixelFormat::kRGB8);
  const auto luma = Decode(jpeg, 32, 24, PixelFormat::kMono8);
  ASSERT_TRUE(rgb.ok() && luma.ok());
  for (size_t i = 0; i < luma->size(); ++i) {
    for (int c = 0; c < 3; ++c) ASSERT_EQ((*rgb)[i * 3 + c], (*luma)[i]);
  }
}

// Cameras leave the usual Huffman tables out, and the kernel's buffer may be longer than the picture.
TEST(Jpeg, WithoutHuffmanTablesAndWithBytesBehindIt) {
  std::vector<uint8_t> jpeg = Encode(32, 24, Smooth);
  const auto whole = Decode(jpeg, 32, 24, PixelFormat::kRGB8);
  ASSERT_TRUE(whole.ok());
  int tables = 0;
  for (size_t i = 2; jpeg[i + 1] != 0xda;) {  // the markers before the scan
    const size_t length = 2 + jpeg[i + 2] * 256u + jpeg[i + 3];
    if (jpeg[i + 1] == 0xc4) {
      jpeg.erase(jpeg.begin() + static_cast<ptrdiff_t>(i),
                 jpeg.begin() + static_cast<ptrdiff_t>(i + length));
      ++tables;
    } else {
      i += length;
    }
  }
  EXPECT_GE(tables, 1);
  jpeg.insert(jpeg.end(), 100, 0);
  const auto decoded = Decode(jpeg, 32, 24, PixelFormat::kRGB8);
  ASSERT_TRUE(decoded.ok()) << decoded.status();
  EXPECT_EQ(*decoded, *whole);
}

// Cameras that send whole blocks of bytes fill the last one up before the end of the picture, not behind it.
TEST(Jpeg, PaddedBeforeItsEnd) {
  const std::vector<uint8_t> jpeg = Encode(32, 24, Smooth);
  const auto whole = Decode(jpeg, 32, 24, PixelFormat::kRGB8);
  ASSERT_TRUE(whole.ok());
  for (const auto& [padding, behind] :
       std::vector<std::pair<int, int>>{{1, 0}, {2, 0}, {3, 5}, {511, 0}, {700, 700}}) {
    for (uint8_t with : {0x00, 0xff}) {
      std::vector<uint8_t> padded = jpeg;
      padded.insert(padded.end() - 2, static_cast<size_t>(padding), with);
      padded.insert(padded.end(), static_cast<size_t>(behind), 0);
      const auto decoded = Decode(padded, 32, 24, PixelFormat::kRGB8);
      ASSERT_TRUE(decoded.ok()) << padding << " of " << int{with} << ": " << decoded.status();
      EXPECT_EQ(*decoded, *whole);
    }
  }
  // Anything else is what is left over from a picture that was damaged, or another's end.
  std::vector<uint8_t> other = jpeg;
  other.insert(other.end() - 2, {0, 0, 7, 0});
  ExpectIncomplete(other, 32, 24, "extraneous");
  other = jpeg;
  other.insert(other.end() - 2, jpeg.end() - 40, jpeg.end() - 2);
  ExpectIncomplete(other, 32, 24);
}

// Zeros are valid data: decoded they are grey blocks, and what is left over of them looks like padding.
TEST(Jpeg, ZerosInPlaceOfItsTailAreNoPadding) {
  for (TJSAMP subsampling : {TJSAMP_444, TJSAMP_422, TJSAMP_420}) {
    const auto noisy = [](int x, int y, int c) {
      return (Smooth(x, y, c) + static_cast<unsigned>(x * 2654435761u + y * 40503u) % 50) % 256;
    };
    const std::vector<uint8_t> jpeg = Encode(320, 240, noisy, subsampling);
    ASSERT_TRUE(Decode(jpeg, 320, 240, PixelFormat::kRGB8).ok());
    const auto size = static_cast<ptrdiff_t>(jpeg.size());
    for (ptrdiff_t lost :
         {size / 2, size / 10, size / 100, ptrdiff_t{40}, ptrdiff_t{17}, ptrdiff_t{8}, ptrdiff_t{6},
          ptrdiff_t{5}, ptrdiff_t{4}, ptrdiff_t{3}, ptrdiff_t{2}, ptrdiff_t{1}}) {
      std::vector<uint8_t> zeros = jpeg;
      std::fill(zeros.end() - 2 - lost, zeros.end() - 2, 0);
      zeros.insert(zeros.end() - 2, 5000, 0);
      SCOPED_TRACE(
          absl::StrCat(lost, " bytes of ", size, ", subsampling ", static_cast<int>(subsampling)));
      ExpectIncomplete(zeros, 320, 240);
    }
  }
}

// Some of an earlier picture, or another's end, after the end of this one: the kernel's buffer may be longer than the picture.
TEST(Jpeg, WhatIsBehindItsEndDoesNotCount) {
  const std::vector<uint8_t> jpeg = Encode(32, 24, Smooth);
  std::vector<uint8_t> behind = jpeg;
  behind.insert(behind.end() - 2, 100, 0);
  behind.insert(behind.end(), jpeg.end() - 60, jpeg.end());
  EXPECT_TRUE(Decode(behind, 32, 24, PixelFormat::kRGB8).ok());
  std::vector<uint8_t> damaged = jpeg;
  damaged.insert(damaged.end() - 2, {0, 7, 0});
  damaged.insert(damaged.end(), 1000, 0);
  damaged.insert(damaged.end(), {0xff, 0xd9});
  ExpectIncomplete(damaged, 32, 24);
}

// The library would fill in what is missing.
TEST(Jpeg, CutOffAnywhereIsIncomplete) {
  const std::vector<uint8_t> jpeg = Encode(32, 24, Smooth);
  for (size_t size = 0; size < jpeg.size(); size += size < 32 || size + 16 > jpeg.size() ? 1 : 13) {
    ExpectIncomplete({jpeg.begin(), jpeg.begin() + static_cast<ptrdiff_t>(size)}, 32, 24);
  }
}

TEST(Jpeg, DamageInTheMiddleIsIncomplete) {
  const std::vector<uint8_t> jpeg = Encode(64, 48, Smooth);
  // A part lost on the way: what follows it is there, to the end.
  std::vector<uint8_t> lost = jpeg;
  lost.erase(lost.end() - 400, lost.end() - 200);
  ExpectIncomplete(lost, 64, 48);
  // The rest is of the buffer's last picture.
  std::vector<uint8_t> zeros = jpeg;
  std::fill(zeros.end() - 300, zeros.end() - 2, 0);
  ExpectIncomplete(zeros, 64, 48);
}

TEST(Jpeg, GarbageIsIncomplete) {
  ExpectIncomplete({}, 32, 24);
  ExpectIncomplete(std::vector<uint8_t>(1000, 0), 32, 24);
  ExpectIncomplete(std::vector<uint8_t>(1000, 0xff), 32, 24);
  std::vector<uint8_t> jpeg = Encode(32, 24, Smooth);
  jpeg[0] = 0;
  ExpectIncomplete(jpeg, 32, 24);
}

TEST(Jpeg, AnotherSizeIsIncompleteBeforeThereIsMemoryForIt) {
  const std::vector<uint8_t> jpeg = Encode(32, 24, Smooth);
  ExpectIncomplete(jpeg, 24, 32, "a picture of 32x24");
  ExpectIncomplete(jpeg, 32, 25, "a picture of 32x24");
  ExpectIncomplete(jpeg, 64, 48, "a picture of 32x24");
  std::vector<uint8_t> huge = jpeg;
  for (size_t i = 2; i + 9 < huge.size(); ++i) {
    if (huge[i] != 0xff || huge[i + 1] != 0xc0) continue;
    for (size_t at : {5, 6, 7, 8}) huge[i + at] = 0xff;  // height, width
    huge[i + 5] = huge[i + 7] = 0xfe;                    // what the library takes
    break;
  }
  ExpectIncomplete(huge, 32, 24, "a picture of 65279x65279");
}

// ---- Through the driver

class MjpegTest : public testing::Test {
 protected:
  MjpegTest() { Plug(0, 0); }
  void Plug(uint32_t ycbcr_enc, uint32_t quantization) {
    FakeSetup setup;
    setup.colorspace = V4L2_COLORSPACE_REC709;  // only the primaries
    setup.ycbcr_enc = ycbcr_enc;
    setup.quantization = quantization;
    setup.formats = {{V4L2_PIX_FMT_MJPEG, {{64, 48}, {32, 24}}}};
    setup.controls = {{V4L2_CID_EXPOSURE_ABSOLUTE, "Exposure Time, Absolute", 1, 5000, 1, 100}};
    setup.compress = [this](int width, int height, const auto& sample) {
      return Encode(width + wider_, height, [&](int x, int y, int c) { return sample(x, y, c); });
    };
    fake_ = std::make_unique<FakeCamera>(setup);
    system_.Add("/dev/video0", fake_.get());
    options_.card = setup.card;
    options_.fourcc = V4L2_PIX_FMT_MJPEG;
  }
  absl::Status Open() {
    ASSIGN_OR_RETURN(camera_, V4l2Camera::Open(system_, options_, {"camera", &clock_, nullptr}));
    return absl::OkStatus();
  }
  Photographer photographer() { return {clock_, *camera_}; }

  RealClock clock_;
  std::atomic<int> wider_{0};  // than it should be
  std::unique_ptr<FakeCamera> fake_;
  FakeVideoSystem system_;
  V4l2Options options_;
  std::unique_ptr<Camera> camera_;
};

TEST_F(MjpegTest, IsTakenOnlyByName) {
  auto document = TomlDocument::Parse("card = \"x\"\nfourcc = \"MJPG\"\n", "rig.toml");
  ASSERT_TRUE(document.ok());
  EXPECT_EQ(ParseV4l2Options(document->root()).fourcc, V4L2_PIX_FMT_MJPEG);
  EXPECT_TRUE(document->Finish().ok());
  options_.fourcc = 0;
  const absl::Status refused = Open();
  EXPECT_EQ(ErrorReason(refused), "DEVICE_UNSUITABLE") << refused;
  EXPECT_THAT(MessageOf(refused), HasSubstr("fourcc = \"MJPG\""));
  EXPECT_EQ(fake_->open_handles(), 0);
}

TEST_F(MjpegTest, ColoursThatAreSaidToBeOtherThanJfifsAreRefused) {
  for (const auto& [ycbcr_enc, quantization] : std::vector<std::pair<uint32_t, uint32_t>>{
           {V4L2_YCBCR_ENC_709, 0}, {V4L2_YCBCR_ENC_601, V4L2_QUANTIZATION_LIM_RANGE}}) {
    Plug(ycbcr_enc, quantization);
    const absl::Status refused = Open();
    EXPECT_EQ(ErrorReason(refused), "CAMERA_FORMAT") << refused;
    EXPECT_THAT(MessageOf(refused), HasSubstr("MJPG is "));
  }
  Plug(V4L2_YCBCR_ENC_601, V4L2_QUANTIZATION_FULL_RANGE);
  const absl::Status opened = Open();
  EXPECT_TRUE(opened.ok()) << opened;
}

TEST_F(MjpegTest, ItsFramesAreDecodedAndTheLogSaysOnceWhatTheyAreWorth) {
  std::ostringstream log;
  const std::shared_ptr<spdlog::logger> before = spdlog::default_logger();
  spdlog::set_default_logger(std::make_shared<spdlog::logger>(
      "test", std::make_shared<spdlog::sinks::ostream_sink_mt>(log)));
  const absl::Status opened = Open();
  ASSERT_TRUE(opened.ok()) << opened;
  EXPECT_EQ(camera_->info().formats, (std::vector{PixelFormat::kMono8, PixelFormat::kRGB8}));
  fake_->SetLight(1);
  for (PixelFormat format : {PixelFormat::kRGB8, PixelFormat::kMono8}) {
    const absl::Status ready = photographer().Ready({format, 32, 24, 0});
    ASSERT_TRUE(ready.ok()) << ready;
    const absl::StatusOr<Frame> frame = photographer().Take(milliseconds(5));
    ASSERT_TRUE(frame.ok()) << frame.status();
    EXPECT_EQ(frame->significant_bits, 8);
    ASSERT_EQ(frame->data.size(), 32u * 24 * SamplesPerPixel(format));
    for (std::byte b : frame->data) ASSERT_NEAR(static_cast<int>(b), 191, 2);
    ASSERT_TRUE(photographer().Disarm().ok());
  }
  camera_.reset();
  spdlog::set_default_logger(before);
  const std::string said = log.str();
  const size_t warning = said.find("not linear");
  ASSERT_NE(warning, std::string::npos) << said;
  EXPECT_EQ(said.find("not linear", warning + 1), std::string::npos) << said;
}

TEST_F(MjpegTest, DamagedPicturesAreIncompleteAndTheNextOneIsGood) {
  ASSERT_TRUE(Open().ok());
  ASSERT_TRUE(photographer().Ready({PixelFormat::kMono8, 32, 24, 0}).ok());
  ASSERT_TRUE(photographer().Take(milliseconds(5)).ok());
  fake_->ShortenNext(20, 50);
  absl::Status taken = photographer().Take(milliseconds(5)).status();
  EXPECT_EQ(ErrorReason(taken), "FRAME_INCOMPLETE") << taken;
  fake_->ShortenNext(0);
  wider_ = 8;
  taken = photographer().Take(milliseconds(5)).status();
  EXPECT_EQ(ErrorReason(taken), "FRAME_INCOMPLETE") << taken;
  EXPECT_THAT(MessageOf(taken), HasSubstr("a picture of 40x24"));
  wider_ = 0;
  taken = photographer().Take(milliseconds(5)).status();
  EXPECT_TRUE(taken.ok()) << taken;
  EXPECT_EQ(fake_->streams_started(), 1);
}

}  // namespace
}  // namespace lightstage
