// What a rig file's camera table with driver = "v4l2" says, as values.
#pragma once

#include <cstdint>
#include <optional>
#include <set>
#include <string>

#include "base/clock.h"
#include "base/toml.h"

namespace lightstage {

struct V4l2Options {
  // Which camera; at least one is given. Empty: any.
  std::string device;    // path of the node
  std::string card;      // as VIDIOC_QUERYCAP names it
  std::string bus_info;  // e.g. "usb-0000:00:14.0-3"

  uint32_t fourcc = 0;                  // the only format to be used; 0: the best one
  std::optional<int> significant_bits;  // of the formats that claim all 16
  std::optional<double> frames_per_s;   // not given: as the camera stands
  int buffers = 4;

  std::optional<double> exposure_unit_us;  // of one step of V4L2_CID_EXPOSURE
  std::optional<Duration> fixed_exposure;  // of a camera without a control for it
  double gain_db_per_step = 0;             // 0: unknown, gain stays at its lowest
  std::set<std::string> leave_automatic;   // names of AutomaticControls()

  // From the end of the first row's exposure to the time stamp. Not given: two frame intervals are waited instead.
  std::optional<Duration> latency;
  bool stamps_at_exposure_start = false;  // time stamps that are flagged so are believed
  int control_delay_frames = 2;           // that a new exposure takes to show
  Duration readout{};  // from exposure end until it can expose again; for plans' estimates
};

// Reads the camera's table strictly; errors go into the table.
V4l2Options ParseV4l2Options(const TomlTable& table);

}  // namespace lightstage
