#include "drivers/v4l2/describe.h"

#include <linux/videodev2.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "drivers/v4l2/pixel_formats.h"

namespace lightstage {
namespace {

// Lists that never end are not read to their end.
constexpr uint32_t kMostFormats = 256, kMostSizes = 1024;

// A fixed field that the kernel fills; not trusted to be terminated.
template <size_t N>
std::string Text(const unsigned char (&field)[N]) {
  const char* text = reinterpret_cast<const char*>(field);
  return std::string(text, strnlen(text, N));
}

int Side(uint32_t value) { return static_cast<int>(std::min<uint32_t>(value, kLargestSide)); }

FrameSizes::Range RangeOf(uint32_t min, uint32_t max, uint32_t step) {
  return {Side(std::max(min, 1u)), Side(max), Side(std::max(step, 1u))};
}

absl::StatusOr<FrameSizes> Sizes(const VideoPort& port, uint32_t fourcc) {
  FrameSizes sizes;
  for (uint32_t i = 0; i < kMostSizes; ++i) {
    v4l2_frmsizeenum size = {};
    size.index = i;
    size.pixel_format = fourcc;
    const int error = port.Try(VIDIOC_ENUM_FRAMESIZES, &size);
    if (error == EINVAL || error == ENOTTY || error == ENODATA) break;
    if (error != 0) return port.ErrorOf(error, "VIDIOC_ENUM_FRAMESIZES");
    if (size.type != V4L2_FRMSIZE_TYPE_DISCRETE) {
      sizes.width =
          RangeOf(size.stepwise.min_width, size.stepwise.max_width, size.stepwise.step_width);
      sizes.height =
          RangeOf(size.stepwise.min_height, size.stepwise.max_height, size.stepwise.step_height);
      break;
    }
    const int width = Side(size.discrete.width), height = Side(size.discrete.height);
    if (width > 0 && height > 0) sizes.discrete.emplace_back(width, height);
  }
  return sizes;
}

}  // namespace

int FrameSizes::MaxWidth() const {
  int best = width.max;
  int64_t area = 0;
  for (const auto& [w, h] : discrete) {
    if (int64_t{w} * h > area) area = int64_t{w} * h, best = w;
  }
  return best;
}

int FrameSizes::MaxHeight() const {
  int best = height.max;
  int64_t area = 0;
  for (const auto& [w, h] : discrete) {
    if (int64_t{w} * h > area) area = int64_t{w} * h, best = h;
  }
  return best;
}

absl::StatusOr<VideoDescription> DescribeVideo(const VideoPort& port) {
  v4l2_capability capability = {};
  if (int error = port.Try(VIDIOC_QUERYCAP, &capability); error != 0) {
    if (error == ENOTTY || error == EINVAL) {
      return port.Refuse("DEVICE_UNSUITABLE", absl::StrCat(port.path(), " is no video device"));
    }
    return port.ErrorOf(error, "VIDIOC_QUERYCAP");
  }
  VideoDescription description;
  description.driver = Text(capability.driver);
  description.card = Text(capability.card);
  description.bus_info = Text(capability.bus_info);
  // A camera may have further nodes, for metadata: what this one does is in device_caps.
  const uint32_t caps = (capability.capabilities & V4L2_CAP_DEVICE_CAPS) != 0
                            ? capability.device_caps
                            : capability.capabilities;
  const bool streams = (caps & V4L2_CAP_STREAMING) != 0;
  description.captures = streams && (caps & V4L2_CAP_VIDEO_CAPTURE) != 0;
  description.multi_planar = !description.captures && (caps & V4L2_CAP_VIDEO_CAPTURE_MPLANE) != 0;
  if (!description.captures) return description;
  for (uint32_t i = 0; i < kMostFormats; ++i) {
    v4l2_fmtdesc format = {};
    format.index = i;
    format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    const int error = port.Try(VIDIOC_ENUM_FMT, &format);
    if (error == EINVAL) break;
    if (error != 0) return port.ErrorOf(error, "VIDIOC_ENUM_FMT");
    ASSIGN_OR_RETURN(FrameSizes sizes, Sizes(port, format.pixelformat));
    description.formats.push_back({format.pixelformat, std::move(sizes)});
  }
  return description;
}

}  // namespace lightstage
