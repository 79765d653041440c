#include "drivers/api/camera.h"

#include <algorithm>
#include <array>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace lightstage {
namespace {

struct FormatTraits {
  PixelFormat format;
  std::string_view name;
  int bytes, samples;
  bool bayer;
};

constexpr std::array kFormats = {
    FormatTraits{PixelFormat::kMono8, "Mono8", 1, 1, false},
    FormatTraits{PixelFormat::kMono16, "Mono16", 2, 1, false},
    FormatTraits{PixelFormat::kBayerRG8, "BayerRG8", 1, 1, true},
    FormatTraits{PixelFormat::kBayerGR8, "BayerGR8", 1, 1, true},
    FormatTraits{PixelFormat::kBayerGB8, "BayerGB8", 1, 1, true},
    FormatTraits{PixelFormat::kBayerBG8, "BayerBG8", 1, 1, true},
    FormatTraits{PixelFormat::kBayerRG16, "BayerRG16", 2, 1, true},
    FormatTraits{PixelFormat::kBayerGR16, "BayerGR16", 2, 1, true},
    FormatTraits{PixelFormat::kBayerGB16, "BayerGB16", 2, 1, true},
    FormatTraits{PixelFormat::kBayerBG16, "BayerBG16", 2, 1, true},
    FormatTraits{PixelFormat::kRGB8, "RGB8", 1, 3, false},
    FormatTraits{PixelFormat::kRGB16, "RGB16", 2, 3, false},
};

const FormatTraits& Traits(PixelFormat format) { return kFormats[static_cast<size_t>(format)]; }

}  // namespace

std::string_view PixelFormatName(PixelFormat format) { return Traits(format).name; }
int BytesPerSample(PixelFormat format) { return Traits(format).bytes; }
int SamplesPerPixel(PixelFormat format) { return Traits(format).samples; }
bool IsBayer(PixelFormat format) { return Traits(format).bayer; }

absl::StatusOr<PixelFormat> ParsePixelFormat(std::string_view name) {
  std::string known;
  for (const auto& traits : kFormats) {
    if (traits.name == name) return traits.format;
    absl::StrAppend(&known, known.empty() ? "" : ", ", traits.name);
  }
  return Error(absl::StatusCode::kInvalidArgument, "PIXEL_FORMAT",
               absl::StrCat("unknown pixel format '", name, "'; known: ", known),
               {{"format", std::string(name)}});
}

int CentredOffset(int sensor, int size, int step) { return (sensor - size) / 2 / step * step; }

bool FitSide(const char* field, int min, int max, int step, int& value,
             std::vector<std::string>& notes) {
  if (value <= 0) {
    notes.push_back(absl::StrFormat("%s: %d, must lie in [%d, %d]", field, value, min, max));
    return false;
  }
  int fit = std::clamp(value, min, max);
  fit = min + (fit - min) / step * step;
  if (fit != value) {
    notes.push_back(absl::StrFormat("%s: %d asked, %d possible (%d to %d in steps of %d)", field,
                                    value, fit, min, max, step));
    value = fit;
  }
  return true;
}

}  // namespace lightstage
