// What a camera can do with the options it was given, and what follows for a configuration. Pure values: no device is touched here.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "drivers/v4l2/controls.h"
#include "drivers/v4l2/describe.h"
#include "drivers/v4l2/options.h"
#include "drivers/v4l2/pixel_formats.h"

namespace lightstage {

struct V4l2Capabilities {
  struct Format {
    VideoFormat video;
    FrameSizes sizes;
  };
  // The exposure control; its values are multiples of `unit_ns`. Nothing: the exposure is fixed.
  struct Exposure {
    ControlRange control;
    double unit_ns = 0;
  };

  VideoDescription description;
  std::vector<Format> formats;  // one for each of ours
  // Region of interest by cropping, in steps; 0: it can not, and only sizes that the camera offers are valid.
  int crop_step = 0;
  int crop_left = 0, crop_top = 0;  // of the sensor's picture elements
  int crop_min_width = 0, crop_min_height = 0;
  int sensor_width = 0, sensor_height = 0;

  std::optional<Exposure> exposure;
  Duration fixed_exposure{};
  Duration frame_limit{};  // no exposure can be longer, by frames_per_s; 0: unknown

  std::optional<ControlRange> gain;
  double gain_db_per_step = 0;

  Duration MinExposure() const;
  Duration MaxExposure() const;
  double MaxGainDb() const;  // the least is 0
  const Format* Find(PixelFormat format) const;

  // Codes of the controls, and what they mean.
  int64_t ExposureCode(Duration exposure) const;
  Duration ExposureOf(int64_t code) const;
  int64_t GainCode(double gain_db) const;

  ConfigResult Validate(const CameraConfig& config) const;
  // `interval`: between frames, as configured; no exposure can be longer. 0: unknown.
  ExposureResult ValidateExposure(Duration exposure, Duration interval) const;

 private:
  int64_t LeastCode() const;
  int64_t GreatestCode(Duration interval) const;
  bool FitSize(const FrameSizes& sizes, CameraConfig& config,
               std::vector<std::string>& notes) const;
};

// The best of the camera's formats for each of ours.
std::vector<V4l2Capabilities::Format> UsableFormats(
    const std::vector<VideoDescription::Format>& offered, const V4l2Options& options);

// "YUYV, MJPG": for messages.
std::string FormatNames(const std::vector<VideoDescription::Format>& offered);

}  // namespace lightstage
