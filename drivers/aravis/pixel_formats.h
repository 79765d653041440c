// GenICam's pixel formats that the driver takes, and their unpacking into those of drivers/api. Pure functions; names, codes and layouts
// from the Pixel Format Naming Convention and the GigE Vision specification.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "drivers/api/camera.h"

namespace lightstage {

enum class GenicamPacking {
  kNone,      // whole bytes a sample, little-endian, in the low bits
  kLsbFirst,  // "p": samples follow each other without a gap, each with its lowest bit first
  kGigE,  // "Packed": 2 samples in 3 bytes: the upper 8 bits of the first, the lower bits of both, the upper 8 of the second
};

struct GenicamFormat {
  std::string_view name;
  uint32_t code = 0;  // GenICam's 32 bits; the second highest byte is the bits that a pixel takes
  PixelFormat format = PixelFormat::kMono8;
  int significant_bits = 8;  // of a sample
  GenicamPacking packing = GenicamPacking::kNone;
};

// For each of our formats the best one first: deeper before shallower, unpacked before packed.
std::span<const GenicamFormat> GenicamFormats();
// nullptr if there is none of this name.
const GenicamFormat* FindGenicamFormat(std::string_view name);

// A row has a multiple of so many pixels, so that it ends with a byte.
int PixelsPerGroup(const GenicamFormat& format);
// Of a row of `width` pixels, which is a multiple of PixelsPerGroup().
size_t GenicamRowBytes(const GenicamFormat& format, int width);

// Rows without padding in `format.format` from rows that are `stride` bytes apart. Empty if `bytes` are fewer than the image needs, or
// its rows do not end with a byte.
std::vector<std::byte> UnpackGenicam(const GenicamFormat& format, std::span<const std::byte> bytes,
                                     int width, int height, size_t stride);

}  // namespace lightstage
