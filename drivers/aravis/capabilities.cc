#include "drivers/aravis/capabilities.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "absl/strings/str_format.h"

namespace lightstage {
namespace {

// The widths whose packed rows end with a byte.
AravisCapabilities::Size InGroups(AravisCapabilities::Size width, int group) {
  for (int i = 0; i < group && width.min % group != 0; ++i) width.min += width.step;
  width.step = std::lcm(width.step, group);
  return width;
}

}  // namespace

std::vector<GenicamFormat> UsableFormats(const std::vector<uint32_t>& codes,
                                         std::string_view only) {
  std::vector<GenicamFormat> formats;
  for (const GenicamFormat& candidate : GenicamFormats()) {
    if (!only.empty() && candidate.name != only) continue;
    bool offered = std::find(codes.begin(), codes.end(), candidate.code) != codes.end();
    bool have = std::any_of(formats.begin(), formats.end(),
                            [&](const GenicamFormat& f) { return f.format == candidate.format; });
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

const GenicamFormat* AravisCapabilities::Find(PixelFormat format) const {
  for (const GenicamFormat& f : formats) {
    if (f.format == format) return &f;
  }
  return nullptr;
}

ConfigResult AravisCapabilities::Validate(const CameraConfig& config) const {
  ConfigResult result{ConfigVerdict::kValid, config, {}};
  bool possible = true;
  const GenicamFormat* genicam = Find(config.format);
  if (!genicam) {
    std::string offered;
    for (const GenicamFormat& f : formats) {
      absl::StrAppend(&offered, offered.empty() ? "" : ", ", PixelFormatName(f.format));
    }
    result.notes.push_back(absl::StrFormat("format: %s is not offered; the camera has %s",
                                           PixelFormatName(config.format), offered));
    possible = false;
  }
  const Size widths = InGroups(width, genicam ? PixelsPerGroup(*genicam) : 1);
  possible &=
      FitSide("width", widths.min, widths.max, widths.step, result.config.width, result.notes);
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

bool AravisCapabilities::SameExposure(Duration set, Duration said) const {
  const Duration step = std::max<Duration>(exposure_step, std::chrono::microseconds(1));
  return std::chrono::abs(said - set) <= step;
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
