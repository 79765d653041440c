// What a node says of itself, without changing it.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "drivers/v4l2/video_port.h"

namespace lightstage {

// Frame sizes of one format.
struct FrameSizes {
  struct Range {
    int min = 0, max = 0, step = 1;
  };
  std::vector<std::pair<int, int>> discrete;  // width, height; empty: any of the ranges
  Range width, height;

  int MaxWidth() const;   // of the largest area
  int MaxHeight() const;  // likewise
};

struct VideoDescription {
  std::string driver, card, bus_info;
  bool captures = false;      // single-planar video capture with streaming
  bool multi_planar = false;  // video capture, but multi-planar only
  struct Format {
    uint32_t fourcc = 0;
    FrameSizes sizes;
  };
  std::vector<Format> formats;

  bool SameCameraAs(const VideoDescription& other) const {
    return driver == other.driver && card == other.card && bus_info == other.bus_info;
  }
};

absl::StatusOr<VideoDescription> DescribeVideo(const VideoPort& port);

}  // namespace lightstage
