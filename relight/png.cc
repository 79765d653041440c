#include "relight/png.h"

#include <png.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "base/status.h"

namespace lightstage::relight {
namespace {

uint8_t ToSrgb(double v) {
  if (!(v > 0)) return 0;  // NaN too
  if (v >= 1) return 255;
  const double s = v <= 0.0031308 ? 12.92 * v : 1.055 * std::pow(v, 1 / 2.4) - 0.055;
  return static_cast<uint8_t>(std::lround(255 * s));
}

}  // namespace

double AutoExposure(const Image& linear, double percentile) {
  std::vector<float> lit;
  const int channels = linear.channels();
  const std::span<const float> p = linear.pixels();
  for (size_t i = 0; i < p.size(); i += channels) {
    const float most = *std::max_element(p.begin() + i, p.begin() + i + channels);
    if (most > 0) lit.push_back(most);
  }
  if (lit.empty()) return 1;
  const auto nth = lit.begin() + static_cast<size_t>((lit.size() - 1) * percentile / 100);
  std::nth_element(lit.begin(), nth, lit.end());
  return 0.9 / *nth;
}

absl::StatusOr<std::string> EncodePng(const Image& linear, double exposure) {
  if (linear.empty() || (linear.channels() != 1 && linear.channels() != 3)) {
    return Error(absl::StatusCode::kInvalidArgument, "IMAGE_INVALID",
                 absl::StrCat("a picture of ", linear.width(), "×", linear.height(), " with ",
                              linear.channels(), " channels cannot be a PNG; it needs 1 or 3"),
                 {{"width", absl::StrCat(linear.width())},
                  {"height", absl::StrCat(linear.height())},
                  {"channels", absl::StrCat(linear.channels())}});
  }
  std::vector<uint8_t> codes;
  codes.reserve(linear.pixels().size());
  for (float v : linear.pixels()) codes.push_back(ToSrgb(exposure * v));

  png_image png = {};
  png.version = PNG_IMAGE_VERSION;
  png.width = linear.width();
  png.height = linear.height();
  png.format = linear.channels() == 1 ? PNG_FORMAT_GRAY : PNG_FORMAT_RGB;
  std::string out(PNG_IMAGE_PNG_SIZE_MAX(png), '\0');
  png_alloc_size_t size = out.size();
  if (!png_image_write_to_memory(&png, out.data(), &size, /*convert_to_8_bit=*/0, codes.data(),
                                 /*row_stride=*/0, /*colormap=*/nullptr)) {
    return Error(absl::StatusCode::kInternal, "PNG_ENCODE",
                 absl::StrCat("libpng: ", static_cast<const char*>(png.message)),
                 {{"detail", static_cast<const char*>(png.message)}});
  }
  out.resize(size);
  return out;
}

absl::Status WritePng(const std::string& path, const Image& linear, double exposure, Env& env) {
  ASSIGN_OR_RETURN(std::string bytes, EncodePng(linear, exposure));
  return env.WriteFile(path, bytes);
}

}  // namespace lightstage::relight
