#include "drivers/v4l2/capabilities.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_format.h"

namespace lightstage {
namespace {

constexpr double kLongestNs = 3600e9;
// Gains in rig files are decimal numbers, steps of gain are not.
constexpr double kGainTolerance = 0.005;

double Us(Duration d) { return Seconds(d) * 1e6; }

}  // namespace

std::string FormatNames(const std::vector<VideoDescription::Format>& offered) {
  std::string names;
  for (const auto& format : offered) {
    absl::StrAppend(&names, names.empty() ? "" : ", ", FourCcName(format.fourcc));
  }
  return names;
}

std::vector<V4l2Capabilities::Format> UsableFormats(
    const std::vector<VideoDescription::Format>& offered, const V4l2Options& options) {
  std::vector<V4l2Capabilities::Format> formats;
  for (VideoFormat candidate : VideoFormats()) {
    if (options.fourcc != 0 ? candidate.fourcc != options.fourcc : candidate.only_by_name) continue;
    const bool have = std::any_of(formats.begin(), formats.end(), [&](const auto& f) {
      return f.video.format == candidate.format;
    });
    if (have) continue;
    for (const auto& format : offered) {
      // A format without any size can not be had.
      if (format.fourcc != candidate.fourcc || format.sizes.MaxWidth() <= 0) continue;
      if (candidate.significant_bits == 16) {
        candidate.significant_bits = options.significant_bits.value_or(16);
      }
      formats.push_back({candidate, format.sizes});
      break;
    }
  }
  return formats;
}

// ---- Exposure

Duration V4l2Capabilities::ExposureOf(int64_t code) const {
  if (!exposure) return fixed_exposure;
  return Duration(
      std::llround(std::clamp(static_cast<double>(code) * exposure->unit_ns, 0.0, kLongestNs)));
}

int64_t V4l2Capabilities::ExposureCode(Duration time) const {
  if (!exposure) return 0;
  return exposure->control.Fit(std::llround(static_cast<double>(time.count()) / exposure->unit_ns));
}

// Zero would be no exposure at all.
int64_t V4l2Capabilities::LeastCode() const {
  const ControlRange& control = exposure->control;
  if (control.min > 0) return control.min;
  return control.min + (-control.min / control.step + 1) * control.step;
}

int64_t V4l2Capabilities::GreatestCode(Duration interval) const {
  const ControlRange& control = exposure->control;
  double limit = kLongestNs;
  for (Duration bound : {frame_limit, interval}) {
    if (bound > Duration::zero()) limit = std::min(limit, static_cast<double>(bound.count()));
  }
  // Down to a whole step; a millionth over it is rounding.
  const auto most = static_cast<int64_t>(limit / exposure->unit_ns * (1 + 1e-6));
  const int64_t least = LeastCode();
  const int64_t top = std::min(control.max, most);
  return top <= least ? least : least + (top - least) / control.step * control.step;
}

Duration V4l2Capabilities::MinExposure() const {
  return exposure ? ExposureOf(LeastCode()) : fixed_exposure;
}

Duration V4l2Capabilities::MaxExposure() const {
  return exposure ? ExposureOf(GreatestCode(Duration::zero())) : fixed_exposure;
}

ExposureResult V4l2Capabilities::ValidateExposure(Duration asked, Duration interval) const {
  if (!exposure) {
    if (asked == fixed_exposure) return {ConfigVerdict::kValid, asked, ""};
    return {asked <= Duration::zero() ? ConfigVerdict::kInvalid : ConfigVerdict::kAdjusted,
            fixed_exposure,
            absl::StrFormat("exposure: %g us asked, can not be set and is %g us "
                            "(fixed_exposure_us)",
                            Us(asked), Us(fixed_exposure))};
  }
  const int64_t low_code = LeastCode(), high_code = GreatestCode(interval);
  const Duration low = ExposureOf(low_code), high = ExposureOf(high_code);
  const std::string range =
      absl::StrFormat("%g to %g us%s", Us(low), Us(high),
                      high < ExposureOf(exposure->control.max) ? ", the time of a frame" : "");
  if (asked <= Duration::zero()) {
    return {ConfigVerdict::kInvalid, asked,
            absl::StrFormat("exposure: %g us asked, must be %s", Us(asked), range)};
  }
  if (asked < low || asked > high) {
    const Duration fit = std::clamp(asked, low, high);
    return {
        ConfigVerdict::kAdjusted, fit,
        absl::StrFormat("exposure: %g us asked, %g us possible (%s)", Us(asked), Us(fit), range)};
  }
  return {ConfigVerdict::kValid, ExposureOf(std::clamp(ExposureCode(asked), low_code, high_code)),
          ""};
}

// ---- Gain

double V4l2Capabilities::MaxGainDb() const {
  if (!gain) return 0;
  const int64_t steps = (gain->max - gain->min) / gain->step;  // whole ones
  return static_cast<double>(steps * gain->step) * gain_db_per_step;
}

int64_t V4l2Capabilities::GainCode(double gain_db) const {
  if (!gain) return 0;
  if (gain_db_per_step <= 0) return gain->min;
  return gain->Fit(gain->min + std::llround(gain_db / gain_db_per_step));
}

// ---- Configuration

const V4l2Capabilities::Format* V4l2Capabilities::Find(PixelFormat format) const {
  for (const Format& f : formats) {
    if (f.video.format == format) return &f;
  }
  return nullptr;
}

bool V4l2Capabilities::FitSize(const FrameSizes& sizes, CameraConfig& config,
                               std::vector<std::string>& notes) const {
  if (crop_step > 0 || sizes.discrete.empty()) {
    FrameSizes::Range width = sizes.width, height = sizes.height;
    if (crop_step > 0) {
      width = {std::max(crop_min_width, crop_step), sensor_width / crop_step * crop_step,
               crop_step};
      height = {std::max(crop_min_height, crop_step), sensor_height / crop_step * crop_step,
                crop_step};
      // The whole sensor is there however odd it is.
      if (config.width == sensor_width) width = {sensor_width, sensor_width, 1};
      if (config.height == sensor_height) height = {sensor_height, sensor_height, 1};
    }
    const bool width_ok = FitSide("width", width.min, width.max, width.step, config.width, notes);
    return FitSide("height", height.min, height.max, height.step, config.height, notes) && width_ok;
  }
  std::string offered;
  for (const auto& [w, h] : sizes.discrete) {
    if (w == config.width && h == config.height) return true;
    absl::StrAppend(&offered, offered.empty() ? "" : ", ", w, "x", h);
  }
  if (config.width <= 0 || config.height <= 0) {
    notes.push_back(absl::StrFormat("width, height: %dx%d, the camera offers %s", config.width,
                                    config.height, offered));
    return false;
  }
  // The smallest that holds what was asked; else the largest.
  std::pair<int, int> best{sizes.MaxWidth(), sizes.MaxHeight()};
  for (const auto& [w, h] : sizes.discrete) {
    if (w >= config.width && h >= config.height &&
        int64_t{w} * h < int64_t{best.first} * best.second) {
      best = {w, h};
    }
  }
  notes.push_back(
      absl::StrFormat("width, height: %dx%d asked, %dx%d possible; the camera offers "
                      "%s",
                      config.width, config.height, best.first, best.second, offered));
  config.width = best.first;
  config.height = best.second;
  return true;
}

ConfigResult V4l2Capabilities::Validate(const CameraConfig& config) const {
  ConfigResult result{ConfigVerdict::kValid, config, {}};
  bool possible = true;
  const Format* format = Find(config.format);
  if (format == nullptr) {
    std::string ours;
    for (const Format& f : formats) {
      absl::StrAppend(&ours, ours.empty() ? "" : ", ", PixelFormatName(f.video.format));
    }
    result.notes.push_back(absl::StrFormat("format: %s is not offered; there is %s",
                                           PixelFormatName(config.format), ours));
    possible = false;
    format = &formats.front();
  }
  possible &= FitSize(format->sizes, result.config, result.notes);
  if (!std::isfinite(config.gain_db)) {
    result.notes.push_back(
        absl::StrFormat("gain_db: %g, must lie in [0, %g]", config.gain_db, MaxGainDb()));
    possible = false;
  } else {
    double fit = std::clamp(config.gain_db, 0.0, MaxGainDb());
    if (gain && gain_db_per_step > 0) {
      fit = static_cast<double>(GainCode(fit) - gain->min) * gain_db_per_step;
    }
    if (std::abs(fit - config.gain_db) > kGainTolerance) {
      result.notes.push_back(absl::StrFormat("gain_db: %g asked, %g possible (0 to %g)",
                                             config.gain_db, fit, MaxGainDb()));
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

}  // namespace lightstage
