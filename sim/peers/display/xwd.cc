#include "sim/peers/display/xwd.h"

#include "absl/strings/str_cat.h"
#include "base/status.h"

namespace lightstage {
namespace {

// Fields of the header, each 32 bits, most significant byte first.
enum Field {
  kHeaderSize = 0,
  kFileVersion = 1,
  kPixmapFormat = 2,
  kWidth = 4,
  kHeight = 5,
  kByteOrder = 7,
  kBitsPerPixel = 11,
  kBytesPerLine = 12,
  kRedMask = 14,
  kGreenMask = 15,
  kBlueMask = 16,
  kColors = 19,
  kFields = 25,
};
constexpr size_t kColorSize = 12;

absl::Status Wrong(std::string_view what) {
  return Error(absl::StatusCode::kInvalidArgument, "XWD", absl::StrCat("XWD file: ", what));
}

}  // namespace

absl::StatusOr<XwdPicture> ParseXwd(std::span<const uint8_t> file) {
  if (file.size() < size_t{4} * kFields) return Wrong("no header");
  auto field = [&](Field f) -> uint64_t {
    const uint8_t* p = file.data() + size_t{4} * f;
    return uint64_t{p[0]} << 24 | uint64_t{p[1]} << 16 | uint64_t{p[2]} << 8 | p[3];
  };
  if (field(kFileVersion) != 7 || field(kPixmapFormat) != 2) return Wrong("not version 7, ZPixmap");
  if (field(kBitsPerPixel) != 32 || field(kRedMask) != 0xff0000 || field(kGreenMask) != 0xff00 ||
      field(kBlueMask) != 0xff) {
    return Wrong("not 32 bits a pixel with eight a channel");
  }
  const uint64_t width = field(kWidth), height = field(kHeight), line = field(kBytesPerLine);
  const uint64_t start = field(kHeaderSize) + field(kColors) * kColorSize;
  if (width == 0 || height == 0 || width > 32768 || height > 32768 || line < width * 4 ||
      start > file.size() || (file.size() - start) / line < height) {
    return Wrong("not as many pixels as its header says");
  }
  XwdPicture picture{static_cast<int>(width), static_cast<int>(height), {}};
  picture.pixels.reserve(width * height);
  const bool msb = field(kByteOrder) != 0;
  for (uint64_t y = 0; y < height; ++y) {
    for (uint64_t x = 0; x < width; ++x) {
      const uint8_t* p = file.data() + start + y * line + x * 4;
      picture.pixels.push_back(msb ? uint32_t{p[1]} << 16 | uint32_t{p[2]} << 8 | p[3]
                                   : uint32_t{p[2]} << 16 | uint32_t{p[1]} << 8 | p[0]);
    }
  }
  return picture;
}

}  // namespace lightstage
