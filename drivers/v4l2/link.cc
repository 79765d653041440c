#include "drivers/v4l2/link.h"

#include <linux/videodev2.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>

#include "absl/strings/str_format.h"

namespace lightstage {
namespace {

constexpr uint32_t kType = V4L2_BUF_TYPE_VIDEO_CAPTURE;
constexpr double kAbsoluteUnitNs = 100e3;  // V4L2_CID_EXPOSURE_ABSOLUTE counts 100 µs
constexpr double kRateTolerance = 0.01;

bool Wanted(const V4l2Options& options, const VideoDescription& found,
            const VideoDescription* same) {
  if (!options.card.empty() && found.card != options.card) return false;
  if (!options.bus_info.empty() && found.bus_info != options.bus_info) return false;
  return same == nullptr || found.SameCameraAs(*same);
}

std::string Named(const V4l2Options& options) {
  std::string named;
  for (const auto& [key, value] :
       {std::pair{"device", &options.device}, std::pair{"card", &options.card},
        std::pair{"bus_info", &options.bus_info}}) {
    if (!value->empty()) {
      absl::StrAppend(&named, named.empty() ? "" : ", ", key, " = \"", *value, "\"");
    }
  }
  return named;
}

struct Found {
  VideoPort port;
  VideoDescription description;
};

absl::StatusOr<Found> LookAt(VideoSystem& system, const std::string& path,
                             const std::string& name) {
  ASSIGN_OR_RETURN(VideoPort port, VideoPort::Open(system, path, name));
  ASSIGN_OR_RETURN(VideoDescription description, DescribeVideo(port));
  return Found{std::move(port), std::move(description)};
}

// The one node that is wanted. A camera that was plugged in again may have another number.
absl::StatusOr<Found> FindCamera(VideoSystem& system, const V4l2Options& options,
                                 const std::string& name, const VideoDescription* same) {
  const bool anywhere = options.device.empty() || same != nullptr;
  std::vector<std::string> paths;
  if (anywhere) {
    paths = system.Paths();
  } else {
    paths = {options.device};
  }
  std::optional<Found> found;
  absl::Status trouble;
  std::string others;
  for (const std::string& path : paths) {
    absl::StatusOr<Found> candidate = LookAt(system, path, name);
    if (!candidate.ok()) {
      trouble = candidate.status();
      if (!anywhere) return trouble;
      continue;
    }
    const VideoDescription& description = candidate->description;
    if (!Wanted(options, description, same) || !description.captures) {
      absl::StrAppend(&others, others.empty() ? "" : "; ", path, ": ", description.card, " (",
                      description.bus_info, ")", description.captures ? "" : " does not capture");
      if (description.multi_planar) absl::StrAppend(&others, " but multi-planar");
      continue;
    }
    if (found) {
      return Error(absl::StatusCode::kFailedPrecondition, "DEVICE_UNSUITABLE",
                   absl::StrCat(name, ": ", Named(options), " is both ", found->port.path(),
                                " and ", path, "; bus_info tells them apart: ",
                                found->description.bus_info, ", ", description.bus_info),
                   {{"device", name}});
    }
    found.emplace(*std::move(candidate));
  }
  if (found) return *std::move(found);
  if (!trouble.ok() && others.empty()) return trouble;
  return Error(absl::StatusCode::kNotFound, "DEVICE_NOT_FOUND",
               absl::StrCat(name, ": no camera is ", Named(options), "; there is ",
                            others.empty() ? "none" : others),
               {{"device", name}, {"found", others}});
}

}  // namespace

absl::StatusOr<std::unique_ptr<V4l2Link>> V4l2Link::Open(VideoSystem& system,
                                                         const V4l2Options& options,
                                                         const std::string& name,
                                                         const VideoDescription* same) {
  ASSIGN_OR_RETURN(Found found, FindCamera(system, options, name, same));
  std::unique_ptr<V4l2Link> link(new V4l2Link(std::move(found.port), options));
  RETURN_IF_ERROR(link->Learn(std::move(found.description)));
  return link;
}

V4l2Link::V4l2Link(VideoPort port, const V4l2Options& options)
    : port_(std::move(port)), options_(options), controls_(port_) {}

V4l2Link::~V4l2Link() { StopStream(); }

// ---- What it can do

absl::Status V4l2Link::Learn(VideoDescription description) {
  V4l2Capabilities& caps = capabilities_;
  caps.description = std::move(description);
  caps.formats = UsableFormats(caps.description.formats, options_);
  if (caps.formats.empty()) {
    std::string why = absl::StrCat("has no usable pixel format: it offers ",
                                   FormatNames(caps.description.formats));
    const auto& offered = caps.description.formats;
    if (std::any_of(offered.begin(), offered.end(),
                    [](const auto& f) { return IsCompressed(f.fourcc); })) {
      absl::StrAppend(&why,
                      "; of compressed pictures the loss would be measured as light: only MJPG is "
                      "decoded, and only if it is named (fourcc = \"MJPG\")");
    }
    if (options_.fourcc != 0) {
      absl::StrAppend(&why, "; fourcc = \"", FourCcName(options_.fourcc), "\" is asked for");
    }
    return port_.Refuse("DEVICE_UNSUITABLE", why);
  }
  if (options_.frames_per_s) {
    caps.frame_limit = FromSeconds(1 / *options_.frames_per_s);
    if (options_.leave_automatic.count("dynamic_frame_rate") > 0) caps.frame_limit = {};
  }
  RETURN_IF_ERROR(controls_.TurnAutomaticOff(options_.leave_automatic));
  RETURN_IF_ERROR(LearnExposure());
  RETURN_IF_ERROR(LearnGain());
  for (const V4l2Capabilities::Format& format : caps.formats) {
    if (int64_t{format.sizes.MaxWidth()} * format.sizes.MaxHeight() >
        int64_t{caps.sensor_width} * caps.sensor_height) {
      caps.sensor_width = format.sizes.MaxWidth();
      caps.sensor_height = format.sizes.MaxHeight();
    }
  }
  LearnCropping();
  // A camera that somebody else uses is told here, not in the first shot.
  const V4l2Capabilities::Format& first = caps.formats.front();
  if (caps.crop_step > 0) return SetRegion(first.video, caps.sensor_width, caps.sensor_height);
  return SetFormat(first.video, first.sizes.MaxWidth(), first.sizes.MaxHeight());
}

absl::Status V4l2Link::LearnExposure() {
  ASSIGN_OR_RETURN(std::optional<ControlRange> units, controls_.Find(V4L2_CID_EXPOSURE));
  ASSIGN_OR_RETURN(std::optional<ControlRange> absolute,
                   controls_.Find(V4L2_CID_EXPOSURE_ABSOLUTE));
  if (units && units->read_only) units.reset();
  if (absolute && absolute->read_only) absolute.reset();
  if (options_.exposure_unit_us && !units) {
    return port_.Refuse("DEVICE_UNSUITABLE",
                        "exposure_unit_us is given, but the camera has no control 'Exposure'");
  }
  if (options_.fixed_exposure) {
    if (units || absolute) {
      return port_.Refuse("DEVICE_UNSUITABLE",
                          absl::StrCat("fixed_exposure_us is given, but the exposure can be set ('",
                                       absolute ? absolute->name : units->name, "')"));
    }
    capabilities_.fixed_exposure = *options_.fixed_exposure;
    return absl::OkStatus();
  }
  if (options_.exposure_unit_us) {
    capabilities_.exposure = {*units, *options_.exposure_unit_us * 1e3};
  } else if (absolute) {
    capabilities_.exposure = {*absolute, kAbsoluteUnitNs};
  } else if (units) {
    return port_.Refuse("DEVICE_UNSUITABLE",
                        absl::StrFormat("the exposure is set in the camera's own units (%d to %d): "
                                        "give exposure_unit_us",
                                        units->min, units->max));
  } else {
    return port_.Refuse("DEVICE_UNSUITABLE",
                        "the exposure can not be set: give fixed_exposure_us if it is known and "
                        "does not change");
  }
  if (capabilities_.exposure->control.max <= 0) {
    return port_.Refuse("DEVICE_UNSUITABLE",
                        absl::StrFormat("the control '%s' has no positive value",
                                        capabilities_.exposure->control.name));
  }
  return absl::OkStatus();
}

// The sensor's gain if it is told apart; what multiplies numbers only stands as the maker made it.
absl::Status V4l2Link::LearnGain() {
  std::optional<ControlRange> gain;
  for (uint32_t id : {V4L2_CID_ANALOGUE_GAIN, V4L2_CID_GAIN, V4L2_CID_DIGITAL_GAIN}) {
    ASSIGN_OR_RETURN(std::optional<ControlRange> control, controls_.Find(id));
    if (!control || control->read_only) continue;
    if (!gain && id != V4L2_CID_DIGITAL_GAIN) {
      gain = control;
    } else {
      RETURN_IF_ERROR(controls_.Set(*control, control->default_value));
    }
  }
  capabilities_.gain = gain;
  capabilities_.gain_db_per_step = gain ? options_.gain_db_per_step : 0;
  if (options_.gain_db_per_step > 0 && !gain) {
    return port_.Refuse("DEVICE_UNSUITABLE",
                        "gain_db_per_step is given, but the camera has no control for its gain");
  }
  return absl::OkStatus();
}

// Whether a region is really cut out, and in which steps, is found by trying: there is nothing to ask.
void V4l2Link::LearnCropping() {
  v4l2_selection whole = {};
  whole.type = kType;
  whole.target = V4L2_SEL_TGT_CROP_DEFAULT;
  if (port_.Try(VIDIOC_G_SELECTION, &whole) != 0) return;
  constexpr uint32_t kLargest = kLargestSide;
  if (whole.r.width == 0 || whole.r.height == 0 || whole.r.width > kLargest ||
      whole.r.height > kLargest) {
    return;
  }
  V4l2Capabilities sized = capabilities_;
  sized.crop_left = whole.r.left;
  sized.crop_top = whole.r.top;
  sized.sensor_width = static_cast<int>(whole.r.width);
  sized.sensor_height = static_cast<int>(whole.r.height);
  // Even, so that the colours of a Bayer pattern stay where they are.
  const VideoFormat& video = capabilities_.formats.front().video;
  const V4l2Capabilities before = std::exchange(capabilities_, sized);
  for (int step : {2, 4, 8, 16, 32, 64}) {
    const int width = sized.sensor_width / step * step - 2 * step;
    const int height = sized.sensor_height / step * step - 2 * step;
    if (width <= 0 || height <= 0) break;
    capabilities_.crop_step = step;
    if (SetRegion(video, width, height).ok()) return LearnSmallestRegion();
  }
  capabilities_ = before;
  Crop(sized.sensor_width, sized.sensor_height).IgnoreError();  // as it was found; S_FMT reads back
}

// What the device makes of a region that is too small.
void V4l2Link::LearnSmallestRegion() {
  V4l2Capabilities& caps = capabilities_;
  const int step = caps.crop_step;
  v4l2_selection crop = {};
  crop.type = kType;
  crop.target = V4L2_SEL_TGT_CROP;
  crop.r = {caps.crop_left, caps.crop_top, static_cast<uint32_t>(step),
            static_cast<uint32_t>(step)};
  if (port_.Try(VIDIOC_S_SELECTION, &crop) != 0) return;
  auto least = [&](uint32_t got, int whole) {
    const int side = static_cast<int>(std::min<uint32_t>(got, whole));
    return std::min((side + step - 1) / step * step, whole / step * step);
  };
  caps.crop_min_width = least(crop.r.width, caps.sensor_width);
  caps.crop_min_height = least(crop.r.height, caps.sensor_height);
}

// ---- Configuration

absl::Status V4l2Link::SetFormat(const VideoFormat& video, int width, int height) {
  v4l2_format format = {};
  format.type = kType;
  format.fmt.pix.width = static_cast<uint32_t>(width);
  format.fmt.pix.height = static_cast<uint32_t>(height);
  format.fmt.pix.pixelformat = video.fourcc;
  format.fmt.pix.field = V4L2_FIELD_NONE;
  RETURN_IF_ERROR(port_.Call(VIDIOC_S_FMT, "VIDIOC_S_FMT", &format));
  format = {};
  format.type = kType;
  RETURN_IF_ERROR(port_.Call(VIDIOC_G_FMT, "VIDIOC_G_FMT", &format));
  const v4l2_pix_format& pix = format.fmt.pix;
  if (pix.pixelformat != video.fourcc || pix.width != static_cast<uint32_t>(width) ||
      pix.height != static_cast<uint32_t>(height)) {
    return port_.Refuse(
        "CAMERA_FORMAT",
        absl::StrFormat("%dx%d %s was set and is %dx%d %s", width, height, FourCcName(video.fourcc),
                        pix.width, pix.height, FourCcName(pix.pixelformat)));
  }
  if (pix.field != V4L2_FIELD_NONE && pix.field != V4L2_FIELD_ANY) {
    return port_.Refuse("CAMERA_FORMAT",
                        absl::StrFormat("the picture is interlaced (field %d)", pix.field));
  }
  const bool yuv = video.packing == Packing::kYuyv || video.packing == Packing::kUyvy;
  // Of which the colours are JFIF's unless it is said otherwise: BT.601, full range.
  const bool jpeg = video.packing == Packing::kJpeg;
  uint32_t encoding = pix.ycbcr_enc;
  if (encoding == V4L2_YCBCR_ENC_DEFAULT) {
    encoding = jpeg ? V4L2_YCBCR_ENC_601 : V4L2_MAP_YCBCR_ENC_DEFAULT(pix.colorspace);
  }
  if ((yuv || jpeg) && encoding != V4L2_YCBCR_ENC_601) {
    return port_.Refuse("CAMERA_FORMAT",
                        absl::StrFormat("%s is encoded otherwise than by BT.601 (encoding %d)",
                                        FourCcName(video.fourcc), encoding));
  }
  uint32_t quantization = pix.quantization;
  if (jpeg && quantization == V4L2_QUANTIZATION_LIM_RANGE) {
    return port_.Refuse("CAMERA_FORMAT",
                        absl::StrCat(FourCcName(video.fourcc),
                                     " is of limited range, which is not known how to decode"));
  }
  if (quantization == V4L2_QUANTIZATION_DEFAULT) {
    quantization = V4L2_MAP_QUANTIZATION_DEFAULT(false, pix.colorspace, encoding);
  }
  yuv_range_ = quantization == V4L2_QUANTIZATION_FULL_RANGE ? YuvRange::kFull : YuvRange::kLimited;
  video_ = video;
  bytes_per_line_ = pix.bytesperline;
  return Compose(width, height);
}

absl::Status V4l2Link::Crop(int width, int height) {
  const V4l2Capabilities& caps = capabilities_;
  const int step = std::max(caps.crop_step, 1);
  v4l2_selection crop = {};
  crop.type = kType;
  crop.target = V4L2_SEL_TGT_CROP;
  crop.r.left = caps.crop_left + CentredOffset(caps.sensor_width, width, step);
  crop.r.top = caps.crop_top + CentredOffset(caps.sensor_height, height, step);
  crop.r.width = static_cast<uint32_t>(width);
  crop.r.height = static_cast<uint32_t>(height);
  const v4l2_rect asked = crop.r;
  RETURN_IF_ERROR(port_.Call(VIDIOC_S_SELECTION, "VIDIOC_S_SELECTION", &crop));
  crop = {};
  crop.type = kType;
  crop.target = V4L2_SEL_TGT_CROP;
  RETURN_IF_ERROR(port_.Call(VIDIOC_G_SELECTION, "VIDIOC_G_SELECTION", &crop));
  if (crop.r.left == asked.left && crop.r.top == asked.top && crop.r.width == asked.width &&
      crop.r.height == asked.height) {
    return absl::OkStatus();
  }
  return port_.Refuse(
      "CAMERA_FORMAT",
      absl::StrFormat("the region %dx%d at (%d, %d) was set and is %dx%d at (%d, %d)", asked.width,
                      asked.height, asked.left, asked.top, crop.r.width, crop.r.height, crop.r.left,
                      crop.r.top));
}

// A device that can put the picture into a part of the frame must fill it.
absl::Status V4l2Link::Compose(int width, int height) {
  v4l2_selection compose = {};
  compose.type = kType;
  compose.target = V4L2_SEL_TGT_COMPOSE;
  if (int error = port_.Try(VIDIOC_G_SELECTION, &compose); error != 0) {
    return error == ENODEV ? port_.ErrorOf(error, "VIDIOC_G_SELECTION") : absl::OkStatus();
  }
  const v4l2_rect whole = {0, 0, static_cast<uint32_t>(width), static_cast<uint32_t>(height)};
  auto fills = [&] { return std::memcmp(&compose.r, &whole, sizeof whole) == 0; };
  if (fills()) return absl::OkStatus();
  compose.r = whole;
  RETURN_IF_ERROR(port_.Call(VIDIOC_S_SELECTION, "VIDIOC_S_SELECTION", &compose));
  compose = {};
  compose.type = kType;
  compose.target = V4L2_SEL_TGT_COMPOSE;
  RETURN_IF_ERROR(port_.Call(VIDIOC_G_SELECTION, "VIDIOC_G_SELECTION", &compose));
  if (fills()) return absl::OkStatus();
  return port_.Refuse("CAMERA_FORMAT",
                      absl::StrFormat("the picture fills %dx%d of a frame of %dx%d",
                                      compose.r.width, compose.r.height, width, height));
}

// The region is set before and after the size: without a scaler the size follows the region, with one a new size may widen it.
absl::Status V4l2Link::SetRegion(const VideoFormat& video, int width, int height) {
  RETURN_IF_ERROR(Crop(width, height));
  RETURN_IF_ERROR(SetFormat(video, width, height));
  RETURN_IF_ERROR(Crop(width, height));
  RETURN_IF_ERROR(Compose(width, height));
  // Setting them may have set the size back.
  v4l2_format format = {};
  format.type = kType;
  RETURN_IF_ERROR(port_.Call(VIDIOC_G_FMT, "VIDIOC_G_FMT", &format));
  if (format.fmt.pix.width == static_cast<uint32_t>(width) &&
      format.fmt.pix.height == static_cast<uint32_t>(height)) {
    return absl::OkStatus();
  }
  return port_.Refuse("CAMERA_FORMAT",
                      absl::StrFormat("a region of %dx%d gives pictures of %dx%d", width, height,
                                      format.fmt.pix.width, format.fmt.pix.height));
}

absl::Status V4l2Link::SetInterval() {
  interval_ = {};
  v4l2_streamparm parameters = {};
  parameters.type = kType;
  v4l2_fract& time = parameters.parm.capture.timeperframe;
  if (options_.frames_per_s) {
    time.numerator = 1000;
    time.denominator = static_cast<uint32_t>(std::llround(*options_.frames_per_s * 1000));
    RETURN_IF_ERROR(port_.Call(VIDIOC_S_PARM, "VIDIOC_S_PARM", &parameters));
  }
  parameters = {};
  parameters.type = kType;
  const int error = port_.Try(VIDIOC_G_PARM, &parameters);
  if (error == ENODEV || (error != 0 && options_.frames_per_s)) {
    return port_.ErrorOf(error, "VIDIOC_G_PARM");
  }
  if (error != 0 || time.numerator == 0 || time.denominator == 0) return absl::OkStatus();
  const double seconds = static_cast<double>(time.numerator) / time.denominator;
  interval_ = FromSeconds(std::min(seconds, 3600.0));
  if (options_.frames_per_s) {
    if (std::abs(seconds * *options_.frames_per_s - 1) > kRateTolerance) {
      return port_.Refuse("CAMERA_FORMAT", absl::StrFormat("frames_per_s = %g was set and is %g",
                                                           *options_.frames_per_s, 1 / seconds));
    }
    interval_ = FromSeconds(1 / *options_.frames_per_s);
  }
  return absl::OkStatus();
}

absl::StatusOr<CameraConfig> V4l2Link::Configure(const CameraConfig& config) {
  StopStream();
  exposure_code_.reset();
  const VideoFormat& video = capabilities_.Find(config.format)->video;
  if (capabilities_.crop_step > 0) {
    RETURN_IF_ERROR(SetRegion(video, config.width, config.height));
  } else {
    RETURN_IF_ERROR(SetFormat(video, config.width, config.height));
  }
  RETURN_IF_ERROR(SetInterval());
  // Again, for another program may have been here since.
  RETURN_IF_ERROR(controls_.TurnAutomaticOff(options_.leave_automatic));
  if (capabilities_.gain) {
    RETURN_IF_ERROR(controls_.Set(*capabilities_.gain, capabilities_.GainCode(config.gain_db)));
  }
  config_ = config;
  return config_;
}

absl::StatusOr<Duration> V4l2Link::SetExposure(Duration exposure, bool* changed) {
  *changed = false;
  if (!capabilities_.exposure) return capabilities_.fixed_exposure;
  const int64_t code = capabilities_.ExposureCode(
      capabilities_.ValidateExposure(exposure, Duration::zero()).exposure);
  if (exposure_code_ != code) {
    exposure_code_.reset();
    *changed = true;
    RETURN_IF_ERROR(controls_.Set(capabilities_.exposure->control, code));
    exposure_code_ = code;
  }
  return capabilities_.ExposureOf(code);
}

// ---- Stream

absl::Status V4l2Link::MapBuffers() {
  v4l2_requestbuffers request = {};
  request.count = static_cast<uint32_t>(options_.buffers);
  request.type = kType;
  request.memory = V4L2_MEMORY_MMAP;
  RETURN_IF_ERROR(port_.Call(VIDIOC_REQBUFS, "VIDIOC_REQBUFS", &request));
  owns_buffers_ = true;
  if (request.count < 2 || request.count > 64) {
    return port_.Refuse("DEVICE_FAULT", absl::StrFormat("%d buffers were asked for and %d given",
                                                        options_.buffers, request.count));
  }
  for (uint32_t i = 0; i < request.count; ++i) {
    v4l2_buffer buffer = {};
    buffer.index = i;
    buffer.type = kType;
    buffer.memory = V4L2_MEMORY_MMAP;
    RETURN_IF_ERROR(port_.Call(VIDIOC_QUERYBUF, "VIDIOC_QUERYBUF", &buffer));
    std::span<std::byte> memory;
    const int error = port_.device().Map(buffer.length, buffer.m.offset, &memory);
    if (error != 0) return port_.ErrorOf(error, "mapping a buffer");
    buffers_.push_back(memory);
    RETURN_IF_ERROR(port_.Call(VIDIOC_QBUF, "VIDIOC_QBUF", &buffer));
  }
  return absl::OkStatus();
}

absl::Status V4l2Link::StartStream() {
  StopStream();
  absl::Status started = MapBuffers();
  if (started.ok()) {
    int type = kType;
    started = port_.Call(VIDIOC_STREAMON, "VIDIOC_STREAMON", &type);
  }
  if (!started.ok()) StopStream();
  return started;
}

void V4l2Link::StopStream() {
  if (!owns_buffers_) return;
  int type = kType;
  port_.Try(VIDIOC_STREAMOFF, &type);
  for (std::span<std::byte> memory : buffers_) port_.device().Unmap(memory);
  buffers_.clear();
  v4l2_requestbuffers request = {};
  request.type = kType;
  request.memory = V4L2_MEMORY_MMAP;
  port_.Try(VIDIOC_REQBUFS, &request);
  owns_buffers_ = false;
}

absl::StatusOr<std::optional<V4l2Link::Taken>> V4l2Link::Take() {
  v4l2_buffer buffer = {};
  buffer.type = kType;
  buffer.memory = V4L2_MEMORY_MMAP;
  const int error = port_.Try(VIDIOC_DQBUF, &buffer);
  if (error == EAGAIN) return std::optional<Taken>();
  if (error != 0) return port_.ErrorOf(error, "VIDIOC_DQBUF");
  if (buffer.index >= buffers_.size()) {
    return port_.Refuse("DEVICE_FAULT", absl::StrFormat("VIDIOC_DQBUF gave buffer %d of %d",
                                                        buffer.index, buffers_.size()));
  }
  Taken taken;
  taken.index = buffer.index;
  taken.sequence = buffer.sequence;
  const auto since_boot = std::chrono::seconds(buffer.timestamp.tv_sec) +
                          std::chrono::microseconds(buffer.timestamp.tv_usec);
  taken.stamp_ns = Duration(since_boot).count();
  // A stamp of zero is one that was forgotten, as some drivers do with damaged frames.
  if ((buffer.flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) == V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC &&
      taken.stamp_ns > 0) {
    taken.stamp = TimePoint(since_boot);
  }
  taken.flagged_start_of_exposure =
      (buffer.flags & V4L2_BUF_FLAG_TSTAMP_SRC_MASK) == V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
  taken.damaged = (buffer.flags & V4L2_BUF_FLAG_ERROR) != 0;
  const std::span<std::byte> memory = buffers_[buffer.index];
  taken.bytes = memory.first(std::min<size_t>(buffer.bytesused, memory.size()));
  return std::optional<Taken>(taken);
}

absl::Status V4l2Link::GiveBack(const Taken& taken) {
  v4l2_buffer buffer = {};
  buffer.index = taken.index;
  buffer.type = kType;
  buffer.memory = V4L2_MEMORY_MMAP;
  return port_.Call(VIDIOC_QBUF, "VIDIOC_QBUF", &buffer);
}

absl::StatusOr<Frame> V4l2Link::Decode(const Taken& taken) const {
  if (taken.damaged) {
    return Error(
        absl::StatusCode::kDataLoss, "FRAME_INCOMPLETE",
        absl::StrFormat("%s: the kernel marked frame %d as damaged", port_.name(), taken.sequence),
        {{"device", port_.name()}, {"frame", absl::StrCat(taken.sequence)}});
  }
  absl::StatusOr<std::vector<std::byte>> pixels =
      Unpack(video_, {taken.bytes, config_.width, config_.height, bytes_per_line_}, yuv_range_);
  if (!pixels.ok()) {
    return Annotate(pixels.status(), absl::StrCat(port_.name(), ": frame ", taken.sequence));
  }
  Frame frame;
  frame.format = video_.format;
  frame.width = config_.width;
  frame.height = config_.height;
  frame.significant_bits = video_.significant_bits;
  frame.data = *std::move(pixels);
  frame.gain_db = config_.gain_db;
  frame.device_timestamp_ns = taken.stamp_ns;
  return frame;
}

}  // namespace lightstage
