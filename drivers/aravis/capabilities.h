// What a camera told about itself when it was opened, and what follows from that for a configuration. Pure values: no device is
// touched here.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/api/camera.h"
#include "drivers/aravis/pixel_formats.h"

namespace lightstage {

struct AravisCapabilities {
  struct Size {
    int min = 1, max = 0, step = 1;
    int offset_step = 1;
    bool has_offset = false;
  };
  enum class Gain { kNone, kDecibels, kRaw };

  std::string vendor, model, serial;
  std::vector<GenicamFormat> formats;
  Size width, height;  // maxima are the sensor's
  Duration min_exposure{}, max_exposure{}, exposure_step{};
  Gain gain = Gain::kNone;
  double min_gain = 0, max_gain = 0;  // dB or raw steps
  double gain_db_per_step = 0;        // raw gain only; 0: unknown

  double MinGainDb() const;
  double MaxGainDb() const;
  const GenicamFormat* Find(PixelFormat format) const;

  ConfigResult Validate(const CameraConfig& config) const;
  ExposureResult ValidateExposure(Duration exposure) const;
  // Whether a frame that says it was exposed for `said` may have been exposed for `set`: they differ by a step at most (by 1 us, the
  // unit of GenICam, if the camera's is finer or unknown).
  bool SameExposure(Duration set, Duration said) const;
};

// The formats of drivers/api that can be served by a camera with these GenICam codes: for each, the camera's best one. If `only` is a
// name, that one alone.
std::vector<GenicamFormat> UsableFormats(const std::vector<uint32_t>& codes,
                                         std::string_view only = {});

}  // namespace lightstage
