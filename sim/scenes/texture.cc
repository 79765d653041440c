#include "sim/scenes/texture.h"

#include <png.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "absl/strings/str_cat.h"
#include "base/status.h"
#include "dataset/exr.h"

namespace lightstage::sim {
namespace {

constexpr int kLargest = 16384;

absl::Status Wrong(const std::string& path, const std::string& why) {
  return Error(absl::StatusCode::kInvalidArgument, "TEXTURE", absl::StrCat(path, ": ", why),
               {{"file", path}});
}

// IEC 61966-2-1.
float FromSrgb(float v) {
  return v <= 0.04045f ? v / 12.92f : std::pow((v + 0.055f) / 1.055f, 2.4f);
}

absl::StatusOr<Image> DecodePng(const std::string& bytes, const std::string& path) {
  png_image png = {};
  png.version = PNG_IMAGE_VERSION;
  if (png_image_begin_read_from_memory(&png, bytes.data(), bytes.size()) == 0) {
    return Wrong(path, absl::StrCat("is no PNG picture: ", png.message));
  }
  if (png.width > kLargest || png.height > kLargest) {
    png_image_free(&png);
    return Wrong(path, absl::StrCat("is ", png.width, " x ", png.height, " pixels; at most ",
                                    kLargest, " x ", kLargest));
  }
  png.format = PNG_FORMAT_RGB;
  std::vector<png_byte> rgb(PNG_IMAGE_SIZE(png));
  const png_color black = {0, 0, 0};
  if (png_image_finish_read(&png, &black, rgb.data(), 0, nullptr) == 0) {
    return Wrong(path, absl::StrCat("cannot be read: ", png.message));
  }
  std::vector<float> linear(256);
  for (int i = 0; i < 256; ++i) linear[i] = FromSrgb(static_cast<float>(i) / 255);
  Image image(static_cast<int>(png.width), static_cast<int>(png.height), 3);
  std::transform(rgb.begin(), rgb.end(), image.pixels().begin(),
                 [&](png_byte v) { return linear[v]; });
  return image;
}

}  // namespace

absl::StatusOr<Image> ReadTexture(const std::string& path, Env& env) {
  ASSIGN_OR_RETURN(std::string bytes, ReadNamedFile(path, env));
  if (!path.ends_with(".exr")) return DecodePng(bytes, path);
  ASSIGN_OR_RETURN(Image picture, DecodeExr(bytes, path));
  Image image(picture.width(), picture.height(), 3);
  for (int y = 0; y < image.height(); ++y) {
    for (int x = 0; x < image.width(); ++x) {
      for (int c = 0; c < 3; ++c) {
        const float v = picture.at(x, y, picture.channels() == 3 ? c : 0);
        if (!(v >= 0 && v <= 1)) {
          return Wrong(path,
                       absl::StrCat("pixel (", x, ", ", y, ") is ", v, ", must be from 0 to 1"));
        }
        image.at(x, y, c) = v;
      }
    }
  }
  return image;
}

Rgb Lookup(const Image& picture, const Vec2f& uv) {
  const int width = picture.width(), height = picture.height();
  const float x = (uv.x() - std::floor(uv.x())) * static_cast<float>(width) - 0.5f;
  const float y = (1 - (uv.y() - std::floor(uv.y()))) * static_cast<float>(height) - 0.5f;
  const float left = std::floor(x), top = std::floor(y);
  Rgb sum = Rgb::Zero();
  for (int j = 0; j < 2; ++j) {
    for (int i = 0; i < 2; ++i) {
      const int px = (static_cast<int>(left) + i + width) % width,
                py = (static_cast<int>(top) + j + height) % height;
      const float weight =
          (i == 1 ? x - left : 1 - (x - left)) * (j == 1 ? y - top : 1 - (y - top));
      sum += weight * Rgb(picture.at(px, py, 0), picture.at(px, py, 1), picture.at(px, py, 2));
    }
  }
  return sum;
}

}  // namespace lightstage::sim
