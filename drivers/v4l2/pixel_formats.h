// V4L2's pixel formats that the driver takes, and their unpacking into those of drivers/api. Pure functions; layouts from the kernel's
// "Video for Linux API", section "Image Formats".
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "drivers/api/camera.h"

namespace lightstage {

enum class Packing {
  kBytes,           // a byte a sample
  kWords,           // 16 bits a sample, little-endian, in the low bits
  kWordsBigEndian,  // 16 bits, big-endian
  kMipi10,  // 4 samples in 5 bytes: their upper 8 bits, then the lower 2 of each, the first one's lowest
  kMipi12,    // 2 samples in 3 bytes, likewise
  kMipi14,    // 4 samples in 7 bytes, likewise
  kBits10,    // 10-bit samples one after the other, the highest bit first
  kRgb,       // red, green, blue
  kBgr,       // blue, green, red
  kYuyv,      // Y0 Cb Y1 Cr
  kUyvy,      // Cb Y0 Cr Y1
  kYuyvLuma,  // of those only Y, as it is
  kUyvyLuma,
  kJpeg,  // a JPEG picture: no rows
};

struct VideoFormat {
  uint32_t fourcc = 0;
  PixelFormat format = PixelFormat::kMono8;
  int significant_bits = 8;
  Packing packing = Packing::kBytes;
  bool only_by_name = false;  // used only if the rig file names the fourcc
};

// For each of our formats the best one first: deeper before shallower, unpacked before packed.
std::span<const VideoFormat> VideoFormats();

// "YUYV", "Y16 -BE" …; other than printable characters as '?'.
std::string FourCcName(uint32_t fourcc);
// The inverse; shorter names are filled up with spaces ("Y10" is "Y10 "). 0 if it is none.
uint32_t FourCc(std::string_view name);
bool IsCompressed(uint32_t fourcc);  // MJPEG, H.264 and the like

// How Y'CbCr is quantised: 16 to 235 (chroma 240) or 0 to 255.
enum class YuvRange { kLimited, kFull };

// An image as it lies in a buffer. `bytes` may be longer or shorter than it should be.
struct RawImage {
  std::span<const std::byte> bytes;
  int width = 0, height = 0;
  size_t bytes_per_line = 0;  // from the beginning of a row to that of the next
};

// Bytes of a row that hold pixels; 0 if the format has no rows. 0 < width <= kLargestSide.
constexpr int kLargestSide = 32768;
size_t RowBytes(Packing packing, int width);

// Rows without padding in `format.format`. DATA_LOSS / FRAME_INCOMPLETE if there are fewer bytes than the image needs; INVALID_ARGUMENT
// / FRAME_LAYOUT if size or line length can not be; FAILED_PRECONDITION / SAMPLE_RANGE if a sample has more than
// `significant_bits`. `range` is for Y'CbCr, taken as ITU-R BT.601's. Of a JPEG picture (jpeg.h) neither it nor bytes_per_line counts.
absl::StatusOr<std::vector<std::byte>> Unpack(const VideoFormat& format, const RawImage& image,
                                              YuvRange range);

}  // namespace lightstage
