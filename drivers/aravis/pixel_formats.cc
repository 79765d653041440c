#include "drivers/aravis/pixel_formats.h"

namespace lightstage {
namespace {

using enum PixelFormat;
using enum GenicamPacking;

constexpr GenicamFormat kFormats[] = {
    {"Mono8", 0x01080001, kMono8, 8, kNone},
    {"Mono16", 0x01100007, kMono16, 16, kNone},
    {"Mono14", 0x01100025, kMono16, 14, kNone},
    {"Mono12", 0x01100005, kMono16, 12, kNone},
    {"Mono12p", 0x010c0047, kMono16, 12, kLsbFirst},
    {"Mono12Packed", 0x010c0006, kMono16, 12, kGigE},
    {"Mono10", 0x01100003, kMono16, 10, kNone},
    {"Mono10p", 0x010a0046, kMono16, 10, kLsbFirst},
    {"Mono10Packed", 0x010c0004, kMono16, 10, kGigE},
    {"BayerRG8", 0x01080009, kBayerRG8, 8, kNone},
    {"BayerGR8", 0x01080008, kBayerGR8, 8, kNone},
    {"BayerGB8", 0x0108000a, kBayerGB8, 8, kNone},
    {"BayerBG8", 0x0108000b, kBayerBG8, 8, kNone},
    {"BayerRG16", 0x0110002f, kBayerRG16, 16, kNone},
    {"BayerRG12", 0x01100011, kBayerRG16, 12, kNone},
    {"BayerRG12p", 0x010c0059, kBayerRG16, 12, kLsbFirst},
    {"BayerRG12Packed", 0x010c002b, kBayerRG16, 12, kGigE},
    {"BayerRG10", 0x0110000d, kBayerRG16, 10, kNone},
    {"BayerRG10p", 0x010a0058, kBayerRG16, 10, kLsbFirst},
    {"BayerRG10Packed", 0x010c0027, kBayerRG16, 10, kGigE},
    {"BayerGR16", 0x0110002e, kBayerGR16, 16, kNone},
    {"BayerGR12", 0x01100010, kBayerGR16, 12, kNone},
    {"BayerGR12p", 0x010c0057, kBayerGR16, 12, kLsbFirst},
    {"BayerGR12Packed", 0x010c002a, kBayerGR16, 12, kGigE},
    {"BayerGR10", 0x0110000c, kBayerGR16, 10, kNone},
    {"BayerGR10p", 0x010a0056, kBayerGR16, 10, kLsbFirst},
    {"BayerGR10Packed", 0x010c0026, kBayerGR16, 10, kGigE},
    {"BayerGB16", 0x01100030, kBayerGB16, 16, kNone},
    {"BayerGB12", 0x01100012, kBayerGB16, 12, kNone},
    {"BayerGB12p", 0x010c0055, kBayerGB16, 12, kLsbFirst},
    {"BayerGB12Packed", 0x010c002c, kBayerGB16, 12, kGigE},
    {"BayerGB10", 0x0110000e, kBayerGB16, 10, kNone},
    {"BayerGB10p", 0x010a0054, kBayerGB16, 10, kLsbFirst},
    {"BayerGB10Packed", 0x010c0028, kBayerGB16, 10, kGigE},
    {"BayerBG16", 0x01100031, kBayerBG16, 16, kNone},
    {"BayerBG12", 0x01100013, kBayerBG16, 12, kNone},
    {"BayerBG12p", 0x010c0053, kBayerBG16, 12, kLsbFirst},
    {"BayerBG12Packed", 0x010c002d, kBayerBG16, 12, kGigE},
    {"BayerBG10", 0x0110000f, kBayerBG16, 10, kNone},
    {"BayerBG10p", 0x010a0052, kBayerBG16, 10, kLsbFirst},
    {"BayerBG10Packed", 0x010c0029, kBayerBG16, 10, kGigE},
    {"RGB8", 0x02180014, kRGB8, 8, kNone},
    {"RGB16", 0x02300033, kRGB16, 16, kNone},
    {"RGB12", 0x0230001a, kRGB16, 12, kNone},
    {"RGB10", 0x02300018, kRGB16, 10, kNone},
};

unsigned At(const std::byte* in, size_t i) { return static_cast<unsigned>(in[i]); }

// Of a row of 10 or 12-bit samples.
unsigned Sample(const GenicamFormat& format, const std::byte* row, int x) {
  const int bits = format.significant_bits, low = bits - 8;
  if (format.packing == kLsbFirst) {
    const size_t bit = static_cast<size_t>(x) * bits;
    const unsigned pair = At(row, bit / 8) | At(row, bit / 8 + 1) << 8;
    return pair >> bit % 8 & ((1u << bits) - 1);
  }
  const std::byte* group = row + ptrdiff_t{x} / 2 * 3;
  return At(group, x % 2 == 0 ? 0 : 2) << low | (At(group, 1) >> 4 * (x % 2) & ((1u << low) - 1));
}

void UnpackRow(const GenicamFormat& format, const std::byte* row, int width, std::byte* out) {
  for (int x = 0; x < width; ++x) {
    const unsigned sample = Sample(format, row, x);
    *out++ = static_cast<std::byte>(sample & 0xff);
    *out++ = static_cast<std::byte>(sample >> 8);
  }
}

}  // namespace

std::span<const GenicamFormat> GenicamFormats() { return kFormats; }

const GenicamFormat* FindGenicamFormat(std::string_view name) {
  for (const GenicamFormat& format : kFormats) {
    if (format.name == name) return &format;
  }
  return nullptr;
}

int PixelsPerGroup(const GenicamFormat& format) {
  if (format.packing == kNone) return 1;
  return format.packing == kLsbFirst && format.significant_bits == 10 ? 4 : 2;
}

size_t GenicamRowBytes(const GenicamFormat& format, int width) {
  return static_cast<size_t>(width) * (format.code >> 16 & 0xff) / 8;
}

std::vector<std::byte> UnpackGenicam(const GenicamFormat& format, std::span<const std::byte> bytes,
                                     int width, int height, size_t stride) {
  const size_t row = GenicamRowBytes(format, width);
  if (width % PixelsPerGroup(format) != 0 || bytes.size() < stride * (height - 1) + row) return {};
  const size_t out_row =
      static_cast<size_t>(width) * SamplesPerPixel(format.format) * BytesPerSample(format.format);
  std::vector<std::byte> out;
  if (format.packing == kNone) {
    // Put behind one another, not into a frame of zeros: to clear it first is one more pass over its memory.
    out.reserve(out_row * height);
    for (int y = 0; y < height; ++y) {
      const std::byte* from = bytes.data() + y * stride;
      out.insert(out.end(), from, from + row);
    }
    return out;
  }
  out.resize(out_row * height);
  for (int y = 0; y < height; ++y) {
    UnpackRow(format, bytes.data() + y * stride, width, out.data() + y * out_row);
  }
  return out;
}

}  // namespace lightstage
