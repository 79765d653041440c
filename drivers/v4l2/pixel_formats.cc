#include "drivers/v4l2/pixel_formats.h"

#include <linux/videodev2.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "absl/strings/str_format.h"
#include "drivers/v4l2/jpeg.h"

namespace lightstage {
namespace {

// Newer than some kernels' headers.
constexpr uint32_t kY12P = v4l2_fourcc('Y', '1', '2', 'P');
constexpr uint32_t kY14P = v4l2_fourcc('Y', '1', '4', 'P');

constexpr VideoFormat kFormats[] = {
    {V4L2_PIX_FMT_GREY, PixelFormat::kMono8, 8, Packing::kBytes},
    {V4L2_PIX_FMT_YUYV, PixelFormat::kMono8, 8, Packing::kYuyvLuma, true},
    {V4L2_PIX_FMT_UYVY, PixelFormat::kMono8, 8, Packing::kUyvyLuma, true},
    {V4L2_PIX_FMT_Y16, PixelFormat::kMono16, 16, Packing::kWords},
    {V4L2_PIX_FMT_Y16_BE, PixelFormat::kMono16, 16, Packing::kWordsBigEndian},
    {V4L2_PIX_FMT_Y14, PixelFormat::kMono16, 14, Packing::kWords},
    {kY14P, PixelFormat::kMono16, 14, Packing::kMipi14},
    {V4L2_PIX_FMT_Y12, PixelFormat::kMono16, 12, Packing::kWords},
    {kY12P, PixelFormat::kMono16, 12, Packing::kMipi12},
    {V4L2_PIX_FMT_Y10, PixelFormat::kMono16, 10, Packing::kWords},
    {V4L2_PIX_FMT_Y10P, PixelFormat::kMono16, 10, Packing::kMipi10},
    {V4L2_PIX_FMT_Y10BPACK, PixelFormat::kMono16, 10, Packing::kBits10},
    {V4L2_PIX_FMT_SRGGB8, PixelFormat::kBayerRG8, 8, Packing::kBytes},
    {V4L2_PIX_FMT_SGRBG8, PixelFormat::kBayerGR8, 8, Packing::kBytes},
    {V4L2_PIX_FMT_SGBRG8, PixelFormat::kBayerGB8, 8, Packing::kBytes},
    {V4L2_PIX_FMT_SBGGR8, PixelFormat::kBayerBG8, 8, Packing::kBytes},
    {V4L2_PIX_FMT_SRGGB16, PixelFormat::kBayerRG16, 16, Packing::kWords},
    {V4L2_PIX_FMT_SRGGB14, PixelFormat::kBayerRG16, 14, Packing::kWords},
    {V4L2_PIX_FMT_SRGGB14P, PixelFormat::kBayerRG16, 14, Packing::kMipi14},
    {V4L2_PIX_FMT_SRGGB12, PixelFormat::kBayerRG16, 12, Packing::kWords},
    {V4L2_PIX_FMT_SRGGB12P, PixelFormat::kBayerRG16, 12, Packing::kMipi12},
    {V4L2_PIX_FMT_SRGGB10, PixelFormat::kBayerRG16, 10, Packing::kWords},
    {V4L2_PIX_FMT_SRGGB10P, PixelFormat::kBayerRG16, 10, Packing::kMipi10},
    {V4L2_PIX_FMT_SGRBG16, PixelFormat::kBayerGR16, 16, Packing::kWords},
    {V4L2_PIX_FMT_SGRBG14, PixelFormat::kBayerGR16, 14, Packing::kWords},
    {V4L2_PIX_FMT_SGRBG14P, PixelFormat::kBayerGR16, 14, Packing::kMipi14},
    {V4L2_PIX_FMT_SGRBG12, PixelFormat::kBayerGR16, 12, Packing::kWords},
    {V4L2_PIX_FMT_SGRBG12P, PixelFormat::kBayerGR16, 12, Packing::kMipi12},
    {V4L2_PIX_FMT_SGRBG10, PixelFormat::kBayerGR16, 10, Packing::kWords},
    {V4L2_PIX_FMT_SGRBG10P, PixelFormat::kBayerGR16, 10, Packing::kMipi10},
    {V4L2_PIX_FMT_SGBRG16, PixelFormat::kBayerGB16, 16, Packing::kWords},
    {V4L2_PIX_FMT_SGBRG14, PixelFormat::kBayerGB16, 14, Packing::kWords},
    {V4L2_PIX_FMT_SGBRG14P, PixelFormat::kBayerGB16, 14, Packing::kMipi14},
    {V4L2_PIX_FMT_SGBRG12, PixelFormat::kBayerGB16, 12, Packing::kWords},
    {V4L2_PIX_FMT_SGBRG12P, PixelFormat::kBayerGB16, 12, Packing::kMipi12},
    {V4L2_PIX_FMT_SGBRG10, PixelFormat::kBayerGB16, 10, Packing::kWords},
    {V4L2_PIX_FMT_SGBRG10P, PixelFormat::kBayerGB16, 10, Packing::kMipi10},
    {V4L2_PIX_FMT_SBGGR16, PixelFormat::kBayerBG16, 16, Packing::kWords},
    {V4L2_PIX_FMT_SBGGR14, PixelFormat::kBayerBG16, 14, Packing::kWords},
    {V4L2_PIX_FMT_SBGGR14P, PixelFormat::kBayerBG16, 14, Packing::kMipi14},
    {V4L2_PIX_FMT_SBGGR12, PixelFormat::kBayerBG16, 12, Packing::kWords},
    {V4L2_PIX_FMT_SBGGR12P, PixelFormat::kBayerBG16, 12, Packing::kMipi12},
    {V4L2_PIX_FMT_SBGGR10, PixelFormat::kBayerBG16, 10, Packing::kWords},
    {V4L2_PIX_FMT_SBGGR10P, PixelFormat::kBayerBG16, 10, Packing::kMipi10},
    {V4L2_PIX_FMT_RGB24, PixelFormat::kRGB8, 8, Packing::kRgb},
    {V4L2_PIX_FMT_BGR24, PixelFormat::kRGB8, 8, Packing::kBgr},
    {V4L2_PIX_FMT_YUYV, PixelFormat::kRGB8, 8, Packing::kYuyv},
    {V4L2_PIX_FMT_UYVY, PixelFormat::kRGB8, 8, Packing::kUyvy},
    {V4L2_PIX_FMT_MJPEG, PixelFormat::kMono8, 8, Packing::kJpeg, true},
    {V4L2_PIX_FMT_MJPEG, PixelFormat::kRGB8, 8, Packing::kJpeg, true},
};

constexpr char kBigEndian[] = "-BE";
constexpr uint32_t kBigEndianBit = 1u << 31;

unsigned At(const std::byte* in, size_t i) { return static_cast<unsigned>(in[i]); }

void Put16(unsigned value, std::byte*& out) {
  *out++ = static_cast<std::byte>(value & 0xff);
  *out++ = static_cast<std::byte>(value >> 8);
}

std::byte Clamped(double value) {
  return static_cast<std::byte>(std::lround(std::clamp(value, 0.0, 255.0)));
}

// ITU-R BT.601: Y' = 0.299 R' + 0.587 G' + 0.114 B', Pb = (B' − Y') / 1.772, Pr = (R' − Y') / 1.402; quantised as section
// "Colorspaces Details" of the kernel's documentation says.
void PutRgb(unsigned y, unsigned cb, unsigned cr, YuvRange range, std::byte*& out) {
  const bool limited = range == YuvRange::kLimited;
  const double luma = limited ? (y - 16.0) * 255 / 219 : y;
  const double scale = limited ? 255.0 / 224 : 1;
  const double pb = (cb - 128.0) * scale, pr = (cr - 128.0) * scale;
  *out++ = Clamped(luma + 1.402 * pr);
  *out++ = Clamped(luma - (0.114 * 1.772 * pb + 0.299 * 1.402 * pr) / 0.587);
  *out++ = Clamped(luma + 1.772 * pb);
}

// One row. `in` has RowBytes(format.packing, width) bytes. Returns all samples or-ed, for formats whose samples could be too great.
unsigned UnpackRow(Packing packing, const std::byte* in, int width, YuvRange range,
                   std::byte* out) {
  unsigned all = 0;
  switch (packing) {
    case Packing::kBytes:
      std::memcpy(out, in, width);
      break;
    case Packing::kWords:
    case Packing::kWordsBigEndian: {
      const size_t low = packing == Packing::kWords ? 0 : 1;
      for (int x = 0; x < width; ++x, in += 2) {
        const unsigned sample = At(in, low) | At(in, 1 - low) << 8;
        all |= sample;
        Put16(sample, out);
      }
      break;
    }
    case Packing::kMipi10:
      for (int x = 0; x < width; ++x) {
        const std::byte* group = in + ptrdiff_t{x} / 4 * 5;
        Put16(At(group, x % 4) << 2 | (At(group, 4) >> 2 * (x % 4) & 3), out);
      }
      break;
    case Packing::kMipi12:
      for (int x = 0; x < width; ++x) {
        const std::byte* group = in + ptrdiff_t{x} / 2 * 3;
        Put16(At(group, x % 2) << 4 | (At(group, 2) >> 4 * (x % 2) & 15), out);
      }
      break;
    case Packing::kMipi14:
      for (int x = 0; x < width; ++x) {
        const std::byte* group = in + ptrdiff_t{x} / 4 * 7;
        const unsigned low = At(group, 4) | At(group, 5) << 8 | At(group, 6) << 16;
        Put16(At(group, x % 4) << 6 | (low >> 6 * (x % 4) & 63), out);
      }
      break;
    case Packing::kBits10:
      for (int x = 0; x < width; ++x) {
        const size_t bit = static_cast<size_t>(x) * 10;
        const unsigned pair = At(in, bit / 8) << 8 | At(in, bit / 8 + 1);
        Put16(pair >> (6 - bit % 8) & 1023, out);
      }
      break;
    case Packing::kRgb:
      std::memcpy(out, in, static_cast<size_t>(width) * 3);
      break;
    case Packing::kBgr:
      for (int x = 0; x < width; ++x, in += 3) {
        *out++ = in[2];
        *out++ = in[1];
        *out++ = in[0];
      }
      break;
    case Packing::kYuyv:
    case Packing::kUyvy: {
      const size_t y = packing == Packing::kYuyv ? 0 : 1, c = 1 - y;
      for (int x = 0; x < width; ++x) {
        const std::byte* pair = in + ptrdiff_t{x} / 2 * 4;
        PutRgb(At(pair, y + (x % 2 == 0 ? 0 : 2)), At(pair, c), At(pair, c + 2), range, out);
      }
      break;
    }
    case Packing::kYuyvLuma:
    case Packing::kUyvyLuma:
      for (int x = 0; x < width; ++x) {
        *out++ = in[static_cast<size_t>(x) * 2 + (packing == Packing::kYuyvLuma ? 0 : 1)];
      }
      break;
    case Packing::kJpeg:
      break;  // Unpack() does not come here
  }
  return all;
}

}  // namespace

std::span<const VideoFormat> VideoFormats() { return kFormats; }

std::string FourCcName(uint32_t fourcc) {
  std::string name;
  for (int shift = 0; shift < 32; shift += 8) {
    const char c = static_cast<char>(fourcc >> shift & (shift == 24 ? 0x7f : 0xff));
    name += c >= ' ' && c <= '~' ? c : '?';
  }
  return (fourcc & kBigEndianBit) != 0 ? name + kBigEndian : name;
}

uint32_t FourCc(std::string_view name) {
  uint32_t fourcc = 0;
  if (name.size() == 7 && name.substr(4) == kBigEndian) {
    fourcc = kBigEndianBit;
    name = name.substr(0, 4);
  }
  if (name.empty() || name.size() > 4) return 0;
  for (size_t i = 0; i < 4; ++i) {
    const char c = i < name.size() ? name[i] : ' ';
    if (c < ' ' || c > '~') return 0;
    fourcc |= static_cast<uint32_t>(c) << 8 * i;
  }
  return fourcc;
}

bool IsCompressed(uint32_t fourcc) {
  for (uint32_t known : {V4L2_PIX_FMT_MJPEG, V4L2_PIX_FMT_JPEG, V4L2_PIX_FMT_MPEG,
                         V4L2_PIX_FMT_H264, V4L2_PIX_FMT_HEVC, V4L2_PIX_FMT_VP8}) {
    if (fourcc == known) return true;
  }
  return false;
}

size_t RowBytes(Packing packing, int width) {
  const size_t w = static_cast<size_t>(width);
  switch (packing) {
    case Packing::kBytes:
      return w;
    case Packing::kWords:
    case Packing::kWordsBigEndian:
      return w * 2;
    case Packing::kMipi10:
      return (w + 3) / 4 * 5;
    case Packing::kMipi12:
      return (w + 1) / 2 * 3;
    case Packing::kMipi14:
      return (w + 3) / 4 * 7;
    case Packing::kBits10:
      return (w * 10 + 7) / 8;
    case Packing::kRgb:
    case Packing::kBgr:
      return w * 3;
    case Packing::kYuyv:
    case Packing::kUyvy:
    case Packing::kYuyvLuma:
    case Packing::kUyvyLuma:
      return (w + 1) / 2 * 4;
    case Packing::kJpeg:
      break;
  }
  return 0;
}

absl::StatusOr<std::vector<std::byte>> Unpack(const VideoFormat& format, const RawImage& image,
                                              YuvRange range) {
  const std::string what =
      absl::StrFormat("%dx%d %s", image.width, image.height, FourCcName(format.fourcc));
  const ErrorMetadata metadata = {{"image", what}};
  const bool size_ok = image.width > 0 && image.width <= kLargestSide && image.height > 0 &&
                       image.height <= kLargestSide;
  if (size_ok && format.packing == Packing::kJpeg) {
    return DecodeJpeg(image.bytes, image.width, image.height, format.format);
  }
  const size_t row = size_ok ? RowBytes(format.packing, image.width) : 0;
  if (!size_ok || image.bytes_per_line < row ||
      image.bytes_per_line > (size_t{1} << 31) / static_cast<size_t>(image.height)) {
    return Error(
        absl::StatusCode::kInvalidArgument, "FRAME_LAYOUT",
        absl::StrFormat("%s with %d bytes per line can not be", what, image.bytes_per_line),
        metadata);
  }
  const size_t needed = image.bytes_per_line * (image.height - 1) + row;
  if (image.bytes.size() < needed) {
    return Error(absl::StatusCode::kDataLoss, "FRAME_INCOMPLETE",
                 absl::StrFormat("%d bytes of %d of %s", image.bytes.size(), needed, what),
                 metadata);
  }
  const size_t out_row = static_cast<size_t>(image.width) * SamplesPerPixel(format.format) *
                         BytesPerSample(format.format);
  std::vector<std::byte> out(out_row * image.height);
  unsigned all = 0;
  for (int y = 0; y < image.height; ++y) {
    all |= UnpackRow(format.packing, image.bytes.data() + y * image.bytes_per_line, image.width,
                     range, out.data() + y * out_row);
  }
  if (all >> format.significant_bits != 0 && BytesPerSample(format.format) == 2) {
    return Error(absl::StatusCode::kFailedPrecondition, "SAMPLE_RANGE",
                 absl::StrFormat("%s has samples with more than %d bits (bits used: 0x%x)", what,
                                 format.significant_bits, all),
                 metadata);
  }
  return out;
}

}  // namespace lightstage
