// The kernel's side of FakeCamera: descriptors, ioctls, poll.
#include <linux/videodev2.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "drivers/v4l2/fake_camera.h"
#include "drivers/v4l2/fake_picture.h"

namespace lightstage {
namespace {

constexpr int kCropStep = 4, kCropLeast = 8;

template <size_t N>
void Fill(unsigned char (&field)[N], const std::string& text) {
  std::memset(field, 0, N);
  std::memcpy(field, text.data(), std::min(text.size(), N - 1));
}

}  // namespace

// One open descriptor.
class FakeHandle final : public VideoDevice {
 public:
  FakeHandle(FakeCamera& camera, uint64_t epoch) : camera_(camera), epoch_(epoch) {}
  ~FakeHandle() override {
    MutexLock lock(&camera_.mutex_);
    --camera_.handles_;
  }
  int Ioctl(unsigned long request, void* argument) override {
    return camera_.Do(epoch_, request, argument);
  }
  int Map(size_t length, off_t offset, std::span<std::byte>* memory) override {
    MutexLock lock(&camera_.mutex_);
    const auto index = static_cast<size_t>(offset / 4096);
    if (index >= camera_.buffers_.size() || camera_.buffers_[index]->memory.size() != length) {
      return EINVAL;
    }
    ++camera_.mappings_;
    *memory = camera_.buffers_[index]->memory;
    return 0;
  }
  void Unmap(std::span<std::byte>) override {
    MutexLock lock(&camera_.mutex_);
    --camera_.mappings_;
  }
  Readiness Wait(Duration timeout, int wake_fd) override {
    const TimePoint end = camera_.clock_.Now() + timeout;
    while (true) {
      uint64_t count;
      [[maybe_unused]] ssize_t n = read(camera_.ready_fd_, &count, sizeof count);
      if (Readiness ready = camera_.Ready(epoch_); ready != Readiness::kNothing) return ready;
      const auto left = std::chrono::ceil<std::chrono::milliseconds>(end - camera_.clock_.Now());
      if (left.count() <= 0) return Readiness::kNothing;
      pollfd fds[2] = {{camera_.ready_fd_, POLLIN, 0}, {wake_fd, POLLIN, 0}};
      poll(fds, 2, static_cast<int>(left.count()));
      if ((fds[1].revents & POLLIN) != 0) return camera_.Ready(epoch_);
    }
  }

 private:
  FakeCamera& camera_;
  const uint64_t epoch_;
};

int FakeCamera::Open(std::unique_ptr<VideoDevice>* device) {
  MutexLock lock(&mutex_);
  if (!plugged_) return ENODEV;
  ++handles_;
  *device = std::make_unique<FakeHandle>(*this, epoch_);
  return 0;
}

VideoDevice::Readiness FakeCamera::Ready(uint64_t epoch) const {
  MutexLock lock(&mutex_);
  if (epoch != epoch_ || broken_ || !streaming_) return VideoDevice::Readiness::kError;
  return done_.empty() ? VideoDevice::Readiness::kNothing : VideoDevice::Readiness::kFrame;
}

int FakeCamera::Do(uint64_t epoch, unsigned long request, void* argument) {
  MutexLock lock(&mutex_);
  if (epoch != epoch_) return ENODEV;
  if (auto failure = failures_.find(request); failure != failures_.end()) {
    const int error = failure->second.first;
    if (--failure->second.second <= 0) failures_.erase(failure);
    return error;
  }
  switch (request) {
    case VIDIOC_QUERYCAP:
    case VIDIOC_ENUM_FMT:
    case VIDIOC_ENUM_FRAMESIZES:
      return Enumerate(request, argument);
    case VIDIOC_QUERY_EXT_CTRL:
    case VIDIOC_G_EXT_CTRLS:
    case VIDIOC_S_EXT_CTRLS:
      return Control(request, argument);
    case VIDIOC_REQBUFS:
    case VIDIOC_QUERYBUF:
    case VIDIOC_QBUF:
    case VIDIOC_DQBUF:
    case VIDIOC_STREAMON:
    case VIDIOC_STREAMOFF:
      return Stream(request, argument);
    default:
      return Format(request, argument);
  }
}

int FakeCamera::Enumerate(unsigned long request, void* argument) {
  if (request == VIDIOC_QUERYCAP) {
    auto& capability = *static_cast<v4l2_capability*>(argument);
    Fill(capability.driver, setup_.driver);
    Fill(capability.card, setup_.card);
    Fill(capability.bus_info, setup_.bus_info);
    capability.device_caps = V4L2_CAP_STREAMING;
    if (setup_.metadata_node) {
      capability.device_caps |= V4L2_CAP_META_CAPTURE;
    } else {
      capability.device_caps |=
          setup_.multi_planar ? V4L2_CAP_VIDEO_CAPTURE_MPLANE : V4L2_CAP_VIDEO_CAPTURE;
    }
    capability.capabilities =
        capability.device_caps | V4L2_CAP_DEVICE_CAPS | V4L2_CAP_VIDEO_CAPTURE;
    return 0;
  }
  if (request == VIDIOC_ENUM_FMT) {
    auto& format = *static_cast<v4l2_fmtdesc*>(argument);
    if (format.index >= setup_.formats.size()) return EINVAL;
    format.pixelformat = setup_.formats[format.index].fourcc;
    return 0;
  }
  auto& size = *static_cast<v4l2_frmsizeenum*>(argument);
  for (const FakeFormat& format : setup_.formats) {
    if (format.fourcc != size.pixel_format) continue;
    if (size.index >= format.sizes.size()) return EINVAL;
    const auto [width, height] = format.sizes[size.index];
    if (format.sizes.size() == 1) {
      size.type = V4L2_FRMSIZE_TYPE_STEPWISE;
      size.stepwise = {2, static_cast<uint32_t>(width), 2, 2, static_cast<uint32_t>(height), 2};
    } else {
      size.type = V4L2_FRMSIZE_TYPE_DISCRETE;
      size.discrete = {static_cast<uint32_t>(width), static_cast<uint32_t>(height)};
    }
    return 0;
  }
  return EINVAL;
}

void FakeCamera::FillFormat(void* argument) const {
  v4l2_pix_format& pix = static_cast<v4l2_format*>(argument)->fmt.pix;
  pix.width = static_cast<uint32_t>(width_);
  pix.height = static_cast<uint32_t>(height_);
  pix.pixelformat = fourcc_;
  pix.field = setup_.field;
  const int line = FakeLineBytes(fourcc_, width_) + setup_.line_padding;
  pix.bytesperline = setup_.compress ? 0 : static_cast<uint32_t>(line);
  pix.sizeimage = static_cast<uint32_t>(line) * pix.height;
  pix.colorspace = setup_.colorspace;
  pix.ycbcr_enc = setup_.ycbcr_enc;
  pix.quantization = setup_.quantization;
}

// Takes the nearest that there is, as drivers must.
int FakeCamera::SetFormat(void* argument) {
  if (!buffers_.empty()) return EBUSY;
  const v4l2_pix_format& pix = static_cast<v4l2_format*>(argument)->fmt.pix;
  const FakeFormat* chosen = &setup_.formats.front();
  for (const FakeFormat& format : setup_.formats) {
    if (format.fourcc == pix.pixelformat) chosen = &format;
  }
  fourcc_ = chosen->fourcc;
  const int64_t asked_width = pix.width, asked_height = pix.height;
  if (setup_.crops) {
    // No scaler: the size is the region's.
    width_ = crop_[2];
    height_ = crop_[3];
  } else if (chosen->sizes.size() == 1) {
    width_ = static_cast<int>(std::clamp<int64_t>(asked_width / 2 * 2, 2, chosen->sizes[0].first));
    height_ =
        static_cast<int>(std::clamp<int64_t>(asked_height / 2 * 2, 2, chosen->sizes[0].second));
  } else {
    auto distance = [&](const std::pair<int, int>& size) {
      return std::abs(size.first - asked_width) + std::abs(size.second - asked_height);
    };
    const auto nearest =
        std::min_element(chosen->sizes.begin(), chosen->sizes.end(),
                         [&](const auto& a, const auto& b) { return distance(a) < distance(b); });
    std::tie(width_, height_) = *nearest;
  }
  composed_[0] = static_cast<uint32_t>(width_) / 2;
  composed_[1] = static_cast<uint32_t>(height_) / 2;
  FillFormat(argument);
  return 0;
}

int FakeCamera::Format(unsigned long request, void* argument) {
  const auto [sensor_width, sensor_height] = setup_.formats.front().sizes.front();
  switch (request) {
    case VIDIOC_S_FMT:
      return SetFormat(argument);
    case VIDIOC_G_FMT:
      FillFormat(argument);
      return 0;
    case VIDIOC_G_SELECTION: {
      auto& selection = *static_cast<v4l2_selection*>(argument);
      if (setup_.composes && selection.target == V4L2_SEL_TGT_COMPOSE) {
        selection.r = {0, 0, composed_[0], composed_[1]};
        return 0;
      }
      if (!setup_.crops) return ENOTTY;
      if (selection.target == V4L2_SEL_TGT_CROP_DEFAULT) {
        selection.r = {0, 0, static_cast<uint32_t>(sensor_width),
                       static_cast<uint32_t>(sensor_height)};
        return 0;
      }
      if (selection.target != V4L2_SEL_TGT_CROP) return EINVAL;
      selection.r = {crop_[0], crop_[1], static_cast<uint32_t>(crop_[2]),
                     static_cast<uint32_t>(crop_[3])};
      return 0;
    }
    case VIDIOC_S_SELECTION: {
      if (!buffers_.empty()) return EBUSY;
      auto& r = static_cast<v4l2_selection*>(argument)->r;
      if (setup_.composes &&
          static_cast<v4l2_selection*>(argument)->target == V4L2_SEL_TGT_COMPOSE) {
        composed_[0] = std::min(r.width, static_cast<uint32_t>(width_));
        composed_[1] = std::min(r.height, static_cast<uint32_t>(height_));
        return 0;
      }
      if (!setup_.crops) return ENOTTY;
      crop_[0] = r.left / kCropStep * kCropStep;
      crop_[1] = r.top / kCropStep * kCropStep;
      crop_[2] =
          std::clamp(static_cast<int>(r.width) / kCropStep * kCropStep, kCropLeast, sensor_width);
      crop_[3] =
          std::clamp(static_cast<int>(r.height) / kCropStep * kCropStep, kCropLeast, sensor_height);
      r.width = static_cast<uint32_t>(crop_[2]);
      r.height = static_cast<uint32_t>(crop_[3]);
      width_ = crop_[2];
      height_ = crop_[3];
      return 0;
    }
    case VIDIOC_G_PARM:
    case VIDIOC_S_PARM: {
      if (!setup_.tells_interval) return ENOTTY;
      auto& time = static_cast<v4l2_streamparm*>(argument)->parm.capture.timeperframe;
      if (request == VIDIOC_S_PARM && time.denominator > 0) {
        // From 10 to 100 frames a second.
        const double asked = static_cast<double>(time.numerator) / time.denominator;
        interval_ = FromSeconds(std::clamp(asked, 0.01, 0.1));
      }
      time = {static_cast<uint32_t>(interval_.count() / 1000), 1000000};
      return 0;
    }
    default:
      return ENOTTY;
  }
}

FakeControl* FakeCamera::FindControl(uint32_t id) {
  for (FakeControl& control : controls_) {
    if (control.id == id) return &control;
  }
  return nullptr;
}

int FakeCamera::Control(unsigned long request, void* argument) {
  if (request == VIDIOC_QUERY_EXT_CTRL) {
    auto& query = *static_cast<v4l2_query_ext_ctrl*>(argument);
    const FakeControl* control = FindControl(query.id);
    if (control == nullptr) return EINVAL;
    query.type = V4L2_CTRL_TYPE_INTEGER;
    std::memset(query.name, 0, sizeof query.name);
    std::memcpy(query.name, control->name.data(),
                std::min(control->name.size(), sizeof query.name - 1));
    query.minimum = control->min;
    query.maximum = control->max;
    query.step = static_cast<uint64_t>(control->step);
    query.default_value = control->default_value.value_or(control->min);
    query.flags = control->flags;
    return 0;
  }
  auto& controls = *static_cast<v4l2_ext_controls*>(argument);
  for (uint32_t i = 0; i < controls.count; ++i) {
    v4l2_ext_control& one = controls.controls[i];
    FakeControl* control = FindControl(one.id);
    if (control == nullptr) return EINVAL;
    if (request == VIDIOC_G_EXT_CTRLS) {
      one.value = static_cast<int32_t>(control->value);
      continue;
    }
    if ((control->flags & V4L2_CTRL_FLAG_READ_ONLY) != 0) return EACCES;
    if (one.value < control->min || one.value > control->max) return ERANGE;
    if (control->stuck) continue;
    control->value = one.value;
    // Its own lines are 25 µs.
    if (one.id == V4L2_CID_EXPOSURE_ABSOLUTE || one.id == V4L2_CID_EXPOSURE) {
      const auto unit = std::chrono::microseconds(one.id == V4L2_CID_EXPOSURE ? 25 : 100);
      exposures_.emplace_back(clock_.Now(), unit * control->value);
    }
  }
  return 0;
}

int FakeCamera::Stream(unsigned long request, void* argument) {
  switch (request) {
    case VIDIOC_REQBUFS: {
      auto& buffers = *static_cast<v4l2_requestbuffers*>(argument);
      if (mappings_ > 0 || (buffers.count > 0 && !buffers_.empty())) return EBUSY;
      buffers_.clear();
      queued_.clear();
      done_.clear();
      buffers.count = std::min(buffers.count, 8u);
      v4l2_format format = {};
      FillFormat(&format);
      for (uint32_t i = 0; i < buffers.count; ++i) {
        buffers_.push_back(std::make_unique<Buffer>());
        buffers_.back()->memory.resize(format.fmt.pix.sizeimage);
      }
      return 0;
    }
    case VIDIOC_QUERYBUF: {
      auto& buffer = *static_cast<v4l2_buffer*>(argument);
      if (buffer.index >= buffers_.size()) return EINVAL;
      buffer.length = static_cast<uint32_t>(buffers_[buffer.index]->memory.size());
      buffer.m.offset = buffer.index * 4096;
      return 0;
    }
    case VIDIOC_QBUF: {
      auto& buffer = *static_cast<v4l2_buffer*>(argument);
      const bool queued = std::count(queued_.begin(), queued_.end(), buffer.index) +
                              std::count(done_.begin(), done_.end(), buffer.index) >
                          0;
      if (buffer.index >= buffers_.size() || queued) return EINVAL;
      queued_.push_back(buffer.index);
      return 0;
    }
    case VIDIOC_DQBUF: {
      if (broken_) return EIO;
      if (!streaming_) return EINVAL;
      if (done_.empty()) return EAGAIN;
      auto& buffer = *static_cast<v4l2_buffer*>(argument);
      buffer.index = done_.front();
      done_.pop_front();
      const Buffer& filled = *buffers_[buffer.index];
      buffer.bytesused = filled.used;
      buffer.sequence = filled.sequence;
      buffer.flags = filled.flags;
      buffer.timestamp = {filled.stamp_us / 1000000, filled.stamp_us % 1000000};
      ++delivered_;
      return 0;
    }
    case VIDIOC_STREAMON:
      if (buffers_.empty()) return EINVAL;
      streaming_ = true;
      ++streams_;
      sequence_ = setup_.first_sequence;
      next_ = clock_.Now() + interval_;
      changed_.SignalAll();
      return 0;
    default:
      streaming_ = false;
      broken_ = cancelled_ = false;
      queued_.clear();
      done_.clear();
      return 0;
  }
}

}  // namespace lightstage
