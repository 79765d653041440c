#include "drivers/v4l2/options.h"

#include "drivers/v4l2/controls.h"
#include "drivers/v4l2/jpeg.h"
#include "drivers/v4l2/pixel_formats.h"

namespace lightstage {
namespace {

uint32_t ParseFormat(const TomlTable& table) {
  if (!table.Has("fourcc")) return 0;
  const std::string name = table.String("fourcc");
  const uint32_t fourcc = FourCc(name);
  for (const VideoFormat& format : VideoFormats()) {
    if (format.fourcc != fourcc) continue;
    if (format.packing == Packing::kJpeg && !CanDecodeJpeg()) {
      table.ErrorAt("fourcc",
                    absl::StrCat("\"", name,
                                 "\" can not be decoded: this was built without libjpeg-turbo "
                                 "(on Debian: libturbojpeg0-dev)"));
    }
    return fourcc;
  }
  std::string known;
  uint32_t last = 0;
  for (const VideoFormat& format : VideoFormats()) {
    if (format.fourcc == last) continue;
    last = format.fourcc;
    absl::StrAppend(&known, known.empty() ? "" : ", ", FourCcName(last));
  }
  if (IsCompressed(fourcc)) {
    table.ErrorAt("fourcc", absl::StrCat("\"", name, "\" is compressed with loss and not decoded; ",
                                         "known: ", known));
  } else {
    table.ErrorAt("fourcc", absl::StrCat("\"", name, "\" is not known; known: ", known));
  }
  return 0;
}

}  // namespace

V4l2Options ParseV4l2Options(const TomlTable& table) {
  V4l2Options options;
  options.device = table.String("device", "");
  options.card = table.String("card", "");
  options.bus_info = table.String("bus_info", "");
  if (options.device.empty() && options.card.empty() && options.bus_info.empty()) {
    table.ErrorAt("",
                  "needs device = \"/dev/video…\", card = \"…\" or bus_info = \"…\", so that "
                  "it can not be another camera");
  }
  options.fourcc = ParseFormat(table);
  if (table.Has("significant_bits")) {
    options.significant_bits = static_cast<int>(table.Int("significant_bits", 9, 16));
  }
  if (table.Has("frames_per_s")) options.frames_per_s = table.Double("frames_per_s", 0.01, 10000);
  options.buffers = static_cast<int>(table.Int("buffers", 3, 32, 4));
  if (table.Has("exposure_unit_us")) {
    options.exposure_unit_us = table.Double("exposure_unit_us", 0.01, 1e6);
  }
  if (table.Has("fixed_exposure_us")) {
    options.fixed_exposure = table.Time("fixed_exposure_us", 1, 60e6);
    if (options.exposure_unit_us) {
      table.ErrorAt("fixed_exposure_us",
                    "is for cameras whose exposure can not be set: it does "
                    "not go with exposure_unit_us");
    }
  }
  options.gain_db_per_step = table.Double("gain_db_per_step", 0, 10, 0.0);
  const TomlTable leave = table.Table("leave_automatic");
  for (const AutomaticControl& control : AutomaticControls()) {
    if (leave.Bool(control.name, false)) options.leave_automatic.insert(control.name);
  }
  if (table.Has("latency_ms")) options.latency = table.Time("latency_ms", 0, 10000);
  options.stamps_at_exposure_start = table.Bool("stamps_at_exposure_start", false);
  options.control_delay_frames = static_cast<int>(table.Int("control_delay_frames", 0, 60, 2));
  options.readout = table.Time("readout_ms", 0, 10000, 0.0);
  return options;
}

}  // namespace lightstage
