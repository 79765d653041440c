#include "drivers/v4l2/fake_picture.h"

#include <linux/videodev2.h>

namespace lightstage {
namespace {

struct Depth {
  int bits;          // of a sample
  int line_bits_x4;  // of four pixels in a row
};

// From the tables of the kernel's section "Image Formats".
Depth DepthOf(uint32_t fourcc) {
  switch (fourcc) {
    case V4L2_PIX_FMT_GREY:
    case V4L2_PIX_FMT_SRGGB8:
    case V4L2_PIX_FMT_SGRBG8:
    case V4L2_PIX_FMT_SGBRG8:
    case V4L2_PIX_FMT_SBGGR8:
      return {8, 32};
    case V4L2_PIX_FMT_Y10:
    case V4L2_PIX_FMT_SRGGB10:
    case V4L2_PIX_FMT_SGRBG10:
    case V4L2_PIX_FMT_SGBRG10:
    case V4L2_PIX_FMT_SBGGR10:
      return {10, 64};
    case V4L2_PIX_FMT_Y12:
    case V4L2_PIX_FMT_SRGGB12:
    case V4L2_PIX_FMT_SBGGR12:
      return {12, 64};
    case V4L2_PIX_FMT_Y14:
    case V4L2_PIX_FMT_SRGGB14:
      return {14, 64};
    case V4L2_PIX_FMT_Y16:
    case V4L2_PIX_FMT_Y16_BE:
    case V4L2_PIX_FMT_SRGGB16:
      return {16, 64};
    case V4L2_PIX_FMT_Y10P:
    case V4L2_PIX_FMT_Y10BPACK:
    case V4L2_PIX_FMT_SRGGB10P:
    case V4L2_PIX_FMT_SGRBG10P:
    case V4L2_PIX_FMT_SGBRG10P:
    case V4L2_PIX_FMT_SBGGR10P:
      return {10, 40};
    case v4l2_fourcc('Y', '1', '2', 'P'):
    case V4L2_PIX_FMT_SRGGB12P:
    case V4L2_PIX_FMT_SBGGR12P:
      return {12, 48};
    case v4l2_fourcc('Y', '1', '4', 'P'):
    case V4L2_PIX_FMT_SRGGB14P:
    case V4L2_PIX_FMT_SBGGR14P:
      return {14, 56};
    case V4L2_PIX_FMT_YUYV:
    case V4L2_PIX_FMT_UYVY:
      return {8, 64};
    default:
      return {8, 96};  // three bytes a pixel, and what is not painted
  }
}

}  // namespace

int FakeBits(uint32_t fourcc) { return DepthOf(fourcc).bits; }

int FakeLineBytes(uint32_t fourcc, int width) {
  return (width + 3) / 4 * DepthOf(fourcc).line_bits_x4 / 8;
}

std::vector<uint8_t> PackLine(uint32_t fourcc, int width,
                              absl::FunctionRef<unsigned(int x, int c)> sample) {
  std::vector<uint8_t> line;
  const Depth depth = DepthOf(fourcc);
  if (fourcc == V4L2_PIX_FMT_RGB24 || fourcc == V4L2_PIX_FMT_BGR24) {
    for (int x = 0; x < width; ++x) {
      for (int c = 0; c < 3; ++c) {
        line.push_back(static_cast<uint8_t>(sample(x, fourcc == V4L2_PIX_FMT_RGB24 ? c : 2 - c)));
      }
    }
  } else if (fourcc == V4L2_PIX_FMT_YUYV || fourcc == V4L2_PIX_FMT_UYVY) {
    for (int x = 0; x < width; ++x) {  // grey: the chroma is in the middle
      const auto luma = static_cast<uint8_t>(sample(x, 0));
      line.push_back(fourcc == V4L2_PIX_FMT_YUYV ? luma : 128);
      line.push_back(fourcc == V4L2_PIX_FMT_YUYV ? 128 : luma);
    }
  } else if (fourcc == V4L2_PIX_FMT_Y10BPACK) {
    std::vector<bool> bits;
    for (int x = 0; x < width; ++x) {
      for (int b = 9; b >= 0; --b) bits.push_back((sample(x, 0) >> b & 1) != 0);
    }
    line.assign((bits.size() + 7) / 8, 0);
    for (size_t i = 0; i < bits.size(); ++i) {
      if (bits[i]) line[i / 8] |= static_cast<uint8_t>(128 >> i % 8);
    }
  } else if (depth.line_bits_x4 == depth.bits * 4 && depth.bits > 8 && depth.bits < 16) {
    // MIPI CSI-2's RAW10, RAW12, RAW14: a group's upper bytes, then its lower bits.
    const int group = depth.bits == 12 ? 2 : 4, low_bits = depth.bits - 8;
    for (int x = 0; x < width; x += group) {
      uint64_t low = 0;
      for (int i = 0; i < group; ++i) {
        const uint64_t value = x + i < width ? sample(x + i, 0) : 0;
        line.push_back(static_cast<uint8_t>(value >> low_bits));
        low += (value % (1u << low_bits)) << (i * low_bits);
      }
      for (int i = 0; i < group * low_bits / 8; ++i, low /= 256) {
        line.push_back(static_cast<uint8_t>(low % 256));
      }
    }
  } else if (depth.bits > 8) {
    for (int x = 0; x < width; ++x) {
      const unsigned value = sample(x, 0);
      const auto low = static_cast<uint8_t>(value % 256), high = static_cast<uint8_t>(value / 256);
      line.push_back(fourcc == V4L2_PIX_FMT_Y16_BE ? high : low);
      line.push_back(fourcc == V4L2_PIX_FMT_Y16_BE ? low : high);
    }
  } else {
    for (int x = 0; x < width; ++x) line.push_back(static_cast<uint8_t>(sample(x, 0)));
  }
  return line;
}

unsigned FakeSample(int x, int y, int c, int bits) {
  return (static_cast<unsigned>(x) * 2731u + static_cast<unsigned>(y) * 977u +
          static_cast<unsigned>(c) * 53u + 5u) %
         (1u << bits);
}

}  // namespace lightstage
