#include "dataset/exr.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_join.h"
#include "base/status.h"
#include "dataset/exr_codec.h"

namespace lightstage {
namespace {

constexpr std::string_view kMagic = "\x76\x2f\x31\x01";  // every OpenEXR file begins so

absl::Status InvalidImage(std::string_view why) {
  return Error(absl::StatusCode::kInvalidArgument, "IMAGE_INVALID",
               absl::StrCat("image cannot be written as EXR: ", why), {{"why", std::string(why)}});
}

}  // namespace

const std::vector<std::string>& ExrCompressionNames() {
  static const auto& names =
      *new std::vector<std::string>{"none", "rle", "zips", "zip", "piz", "dwaa"};
  return names;
}

const std::string& ExrCompressionName(ExrCompression compression) {
  return ExrCompressionNames()[static_cast<size_t>(compression)];
}

absl::StatusOr<ExrCompression> ParseExrCompression(std::string_view name) {
  const auto& names = ExrCompressionNames();
  auto it = std::find(names.begin(), names.end(), name);
  if (it == names.end()) {
    return Error(
        absl::StatusCode::kInvalidArgument, "EXR_COMPRESSION",
        absl::StrCat("compression '", name, "'; must be one of ", absl::StrJoin(names, ", ")),
        {{"compression", std::string(name)}});
  }
  return static_cast<ExrCompression>(it - names.begin());
}

absl::StatusOr<Image> DecodeExr(std::string_view bytes, std::string_view name) {
  Image image;
  RETURN_IF_ERROR(exr_codec::Read(bytes, name, [&](Imf::InputFile& file) -> absl::Status {
    ASSIGN_OR_RETURN(image, exr_codec::ReadPixels(file, name));
    return absl::OkStatus();
  }));
  return image;
}

absl::StatusOr<Image> ReadExr(const std::string& path, Env& env) {
  // Large files of another kind are not read whole to learn that.
  ASSIGN_OR_RETURN(const std::string head, env.ReadRange(path, 0, kMagic.size()));
  if (head != kMagic) return exr_codec::Corrupt(path, "is no OpenEXR file");
  ASSIGN_OR_RETURN(std::string bytes, ReadNamedFile(path, env));
  return DecodeExr(bytes, path);
}

absl::StatusOr<std::string> EncodeExr(const Image& image, ExrPixelType type,
                                      ExrCompression compression) {
  if (image.empty() || (image.channels() != 1 && image.channels() != 3)) {
    return InvalidImage(absl::StrCat("it is ", image.width(), "x", image.height(), " with ",
                                     image.channels(), " channels; 1 or 3 are written"));
  }
  std::vector<std::string> names = exr_codec::ChannelNames(image.channels());
  Imf::PixelType pixel_type = type == ExrPixelType::kHalf ? Imf::HALF : Imf::FLOAT;
  std::vector<uint16_t> halves;
  const char* base = reinterpret_cast<const char*>(image.pixels().data());
  size_t sample = sizeof(float);
  if (type == ExrPixelType::kHalf) {
    halves.resize(image.pixels().size());
    if (exr_codec::ToHalf(image.pixels().data(), halves.size(), halves.data()) ==
        exr_codec::HalfResult::kNotFinite) {
      return InvalidImage("a pixel is not finite");
    }
    base = reinterpret_cast<const char*>(halves.data());
    sample = sizeof(uint16_t);
  } else if (!std::all_of(image.pixels().begin(), image.pixels().end(),
                          [](float v) { return std::isfinite(v); })) {
    return InvalidImage("a pixel is not finite");
  }
  std::vector<exr_codec::Plane> planes;
  size_t pixel = sample * names.size();
  for (size_t c = 0; c < names.size(); ++c) {
    planes.push_back({names[c], pixel_type, base + c * sample, pixel,
                      pixel * static_cast<size_t>(image.width())});
  }
  return exr_codec::Write(
      exr_codec::MakeHeader(image.width(), image.height(), names, pixel_type, compression), planes);
}

absl::Status WriteExr(const std::string& path, const Image& image, ExrPixelType type,
                      ExrCompression compression, Env& env) {
  auto bytes = EncodeExr(image, type, compression);
  if (!bytes.ok()) return Annotate(bytes.status(), path);
  return env.WriteFile(path, *bytes);
}

}  // namespace lightstage
