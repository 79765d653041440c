#include "drivers/aravis/capabilities.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>

#include "absl/strings/str_format.h"

namespace lightstage {
namespace {

using Format = AravisCapabilities::Format;

// GenICam PFNC codes, best first for each of our formats. Unpacked 10 to 14-bit formats are little-endian in the low bits of 16.
constexpr Format kUsable[] = {
    {PixelFormat::kMono8, 0x01080001, 8},      {PixelFormat::kMono16, 0x01100007, 16},
    {PixelFormat::kMono16, 0x01100025, 14},    {PixelFormat::kMono16, 0x01100005, 12},
    {PixelFormat::kMono16, 0x01100003, 10},    {PixelFormat::kBayerRG8, 0x01080009, 8},
    {PixelFormat::kBayerGR8, 0x01080008, 8},   {PixelFormat::kBayerGB8, 0x0108000a, 8},
    {PixelFormat::kBayerBG8, 0x0108000b, 8},   {PixelFormat::kBayerRG16, 0x0110002f, 16},
    {PixelFormat::kBayerRG16, 0x01100011, 12}, {PixelFormat::kBayerRG16, 0x0110000d, 10},
    {PixelFormat::kBayerGR16, 0x0110002e, 16}, {PixelFormat::kBayerGR16, 0x01100010, 12},
    {PixelFormat::kBayerGR16, 0x0110000c, 10}, {PixelFormat::kBayerGB16, 0x01100030, 16},
    {PixelFormat::kBayerGB16, 0x01100012, 12}, {PixelFormat::kBayerGB16, 0x0110000e, 10},
    {PixelFormat::kBayerBG16, 0x01100031, 16}, {PixelFormat::kBayerBG16, 0x01100013, 12},
    {PixelFormat::kBayerBG16, 0x0110000f, 10}, {PixelFormat::kRGB8, 0x02180014, 8},
    {PixelFormat::kRGB16, 0x02300033, 16},     {PixelFormat::kRGB16, 0x0230001a, 12},
    {PixelFormat::kRGB16, 0x02300018, 10},
};

}  // namespace

std::vector<Format> UsableFormats(const std::vector<uint32_t>& codes) {
  std::vector<Format> formats;
  for (const Format& candidate : kUsable) {
    bool offered = std::find(codes.begin(), codes.end(), candidate.code) != codes.end();
    bool have = std::any_of(formats.begin(), formats.end(),
                            [&](const Format& f) { return f.format == candidate.format; });
    if (offered && !have) formats.push_back(candidate);
  }
  return formats;
}

double AravisCapabilities::MinGainDb() const { return gain == Gain::kDecibels ? min_gain : 0; }

double AravisCapabilities::MaxGainDb() const {
  switch (gain) {
    case Gain::kNone:
      return 0;
    case Gain::kDecibels:
      return max_gain;
    case Gain::kRaw:
      return (max_gain - min_gain) * gain_db_per_step;
  }
  return 0;
}

const Format* AravisCapabilities::Find(PixelFormat format) const {
  for (const Format& f : formats) {
    if (f.format == format) return &f;
  }
  return nullptr;
}

ConfigResult AravisCapabilities::Validate(const CameraConfig& config) const {
  ConfigResult result{ConfigVerdict::kValid, config, {}};
  bool possible = true;
  if (!Find(config.format)) {
    std::string offered;
    for (const Format& f : formats) {
      absl::StrAppend(&offered, offered.empty() ? "" : ", ", PixelFormatName(f.format));
    }
    result.notes.push_back(absl::StrFormat("format: %s is not offered; the camera has %s",
                                           PixelFormatName(config.format), offered));
    possible = false;
  }
  possible &= FitSide("width", width.min, width.max, width.step, result.config.width, result.notes);
  possible &=
      FitSide("height", height.min, height.max, height.step, result.config.height, result.notes);
  if (!std::isfinite(config.gain_db)) {
    result.notes.push_back(absl::StrFormat("gain_db: %g, must lie in [%g, %g]", config.gain_db,
                                           MinGainDb(), MaxGainDb()));
    possible = false;
  } else {
    double fit = std::clamp(config.gain_db, MinGainDb(), MaxGainDb());
    if (gain == Gain::kRaw && gain_db_per_step > 0) {
      fit = std::round(fit / gain_db_per_step) * gain_db_per_step;
    }
    if (std::abs(fit - config.gain_db) > 1e-9) {
      result.notes.push_back(absl::StrFormat("gain_db: %g asked, %g possible (%g to %g)",
                                             config.gain_db, fit, MinGainDb(), MaxGainDb()));
      result.config.gain_db = fit;
    }
  }
  if (!possible) {
    result.verdict = ConfigVerdict::kInvalid;
  } else if (!result.notes.empty()) {
    result.verdict = ConfigVerdict::kAdjusted;
  }
  return result;
}

ExposureResult AravisCapabilities::ValidateExposure(Duration exposure) const {
  std::string range =
      absl::StrFormat("%g to %g us", Seconds(min_exposure) * 1e6, Seconds(max_exposure) * 1e6);
  if (exposure <= Duration::zero()) {
    return {ConfigVerdict::kInvalid, exposure,
            absl::StrFormat("exposure: %g us asked, must be %s", Seconds(exposure) * 1e6, range)};
  }
  Duration fit = std::clamp(exposure, min_exposure, max_exposure);
  if (fit != exposure) {
    return {ConfigVerdict::kAdjusted, fit,
            absl::StrFormat("exposure: %g us asked, %g us possible (%s)", Seconds(exposure) * 1e6,
                            Seconds(fit) * 1e6, range)};
  }
  if (exposure_step > Duration::zero()) {
    auto steps = (exposure - min_exposure + exposure_step / 2) / exposure_step;
    fit = std::min(min_exposure + steps * exposure_step, max_exposure);
  }
  return {ConfigVerdict::kValid, fit, ""};
}

}  // namespace lightstage
