#include "drivers/v4l2/fake_camera.h"

#include <linux/videodev2.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "drivers/v4l2/fake_picture.h"

namespace lightstage {
FakeCamera::FakeCamera(FakeSetup setup)
    : setup_(std::move(setup)),
      ready_fd_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)),
      controls_(setup_.controls),
      interval_(setup_.interval),
      stamp_(setup_.stamp) {
  if (!setup_.formats.empty()) {
    fourcc_ = setup_.formats.front().fourcc;
    std::tie(width_, height_) = setup_.formats.front().sizes.front();
  }
  crop_[2] = width_;
  crop_[3] = height_;
  light_.emplace_back(TimePoint{}, 0.0);
  exposures_.emplace_back(TimePoint{}, setup_.fixed_exposure);
  thread_ = std::thread([this] { Run(); });
}

FakeCamera::~FakeCamera() {
  {
    MutexLock lock(&mutex_);
    quit_ = true;
    changed_.SignalAll();
  }
  thread_.join();
  close(ready_fd_);
}

void FakeCamera::Signal() {
  changed_.SignalAll();
  const uint64_t one = 1;
  [[maybe_unused]] ssize_t n = write(ready_fd_, &one, sizeof one);
}

// ---- The world

void FakeCamera::SetLight(double level) {
  MutexLock lock(&mutex_);
  light_.emplace_back(clock_.Now(), level);
}

// Mean over the time.
double FakeCamera::Light(TimePoint from, TimePoint to) const {
  double sum = 0;
  for (size_t i = 0; i < light_.size(); ++i) {
    const TimePoint begin = std::max(from, light_[i].first);
    const TimePoint end = i + 1 < light_.size() ? std::min(to, light_[i + 1].first) : to;
    if (end > begin) sum += light_[i].second * Seconds(end - begin);
  }
  return sum / Seconds(to - from);
}

Duration FakeCamera::ExposureAt(TimePoint time) const {
  Duration exposure = exposures_.front().second;
  for (const auto& [from, value] : exposures_) {
    if (from <= time) exposure = value;
  }
  return exposure;
}

// ---- Faults and state

void FakeCamera::Unplug() {
  MutexLock lock(&mutex_);
  plugged_ = false;
  ++epoch_;
  streaming_ = false;
  Signal();
}
void FakeCamera::PlugIn() {
  MutexLock lock(&mutex_);
  plugged_ = true;
  broken_ = cancelled_ = false;
  queued_.clear();
  done_.clear();
  buffers_.clear();
  // A camera that was without power has forgotten what it was told.
  controls_ = setup_.controls;
}
bool FakeCamera::plugged() const {
  MutexLock lock(&mutex_);
  return plugged_;
}
void FakeCamera::FailNext(unsigned long request, int error, int times) {
  MutexLock lock(&mutex_);
  failures_[request] = {error, times};
}
bool FakeCamera::fails_next(unsigned long request) const {
  MutexLock lock(&mutex_);
  return failures_.count(request) != 0;
}
void FakeCamera::SetSilent(bool silent) {
  MutexLock lock(&mutex_);
  silent_ = silent;
}
void FakeCamera::BreakStream() {
  MutexLock lock(&mutex_);
  broken_ = true;
  Signal();
}
void FakeCamera::CancelBuffers() {
  MutexLock lock(&mutex_);
  for (uint32_t index : queued_) {
    Buffer& buffer = *buffers_[index];
    buffer.used = buffer.sequence = 0;
    buffer.stamp_us = 0;
    buffer.flags = V4L2_BUF_FLAG_ERROR | V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
    done_.push_back(index);
  }
  queued_.clear();
  cancelled_ = true;
  Signal();
}
void FakeCamera::DropNext(int frames) {
  MutexLock lock(&mutex_);
  drop_ = frames;
}
void FakeCamera::DamageNext(int frames) {
  MutexLock lock(&mutex_);
  damage_ = frames;
}
void FakeCamera::ShortenNext(int frames, int bytes) {
  MutexLock lock(&mutex_);
  shorten_ = frames;
  shorten_by_ = bytes;
}
void FakeCamera::NumberNextBack(uint32_t by) {
  MutexLock lock(&mutex_);
  back_ = by;
}
void FakeCamera::SetStamp(FakeStamp stamp) {
  MutexLock lock(&mutex_);
  stamp_ = stamp;
}
void FakeCamera::SetControl(uint32_t id, int64_t value) {
  MutexLock lock(&mutex_);
  FindControl(id)->value = value;
}
int64_t FakeCamera::control(uint32_t id) const {
  MutexLock lock(&mutex_);
  for (const FakeControl& control : controls_) {
    if (control.id == id) return control.value;
  }
  return -1;
}
int FakeCamera::open_handles() const {
  MutexLock lock(&mutex_);
  return handles_;
}
int FakeCamera::mappings() const {
  MutexLock lock(&mutex_);
  return mappings_;
}
int FakeCamera::streams_started() const {
  MutexLock lock(&mutex_);
  return streams_;
}
int FakeCamera::delivered() const {
  MutexLock lock(&mutex_);
  return delivered_;
}
std::pair<int, int> FakeCamera::region_at() const {
  MutexLock lock(&mutex_);
  return {crop_[0], crop_[1]};
}

// ---- The sensor

void FakeCamera::Run() {
  MutexLock lock(&mutex_);
  while (!quit_) {
    if (!streaming_ || broken_ || cancelled_) {
      changed_.Wait(&mutex_);
      continue;
    }
    const Duration left = next_ - clock_.Now();
    if (left > Duration::zero()) {
      changed_.WaitFor(&mutex_, left);
      continue;
    }
    // On a busy machine the whole camera is late, not only its thread: what it says of its frames stays true.
    const TimePoint now = clock_.Now();
    next_ = std::max(next_ + interval_, now + interval_ / 2);
    if (!silent_) Produce(now);
  }
}

void FakeCamera::Produce(TimePoint complete) {
  const uint32_t number = sequence_++ - std::exchange(back_, 0);
  sequence_ = number + 1;
  if (drop_ > 0) {
    --drop_;
    return;
  }
  if (queued_.empty()) return;
  const uint32_t index = queued_.front();
  queued_.pop_front();
  Buffer& buffer = *buffers_[index];
  const TimePoint read_from = complete - setup_.transport - setup_.readout;
  const Duration exposure = ExposureAt(read_from - setup_.exposure_delay_frames * interval_);
  Paint(buffer, read_from, exposure);
  buffer.sequence = number;
  buffer.flags = V4L2_BUF_FLAG_DONE | V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
  TimePoint stamp = complete;
  switch (stamp_) {
    case FakeStamp::kEndOfFrame:
      break;
    case FakeStamp::kFirstPacket:
      stamp = read_from + setup_.transport;
      buffer.flags |= V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
      break;
    case FakeStamp::kExposure:
      stamp = read_from - exposure;
      buffer.flags |= V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
      break;
    case FakeStamp::kFuture:
      stamp = complete + interval_ * 9 / 10;
      break;
    case FakeStamp::kUnknownClock:
      buffer.flags &= ~static_cast<uint32_t>(V4L2_BUF_FLAG_TIMESTAMP_MASK);
      stamp = TimePoint(std::chrono::hours(1));
      break;
  }
  buffer.stamp_us = std::chrono::floor<std::chrono::microseconds>(stamp.time_since_epoch()).count();
  if (damage_ > 0) {
    --damage_;
    buffer.flags |= V4L2_BUF_FLAG_ERROR;
  }
  if (shorten_ > 0) {
    --shorten_;
    buffer.used -= static_cast<uint32_t>(shorten_by_);
  }
  done_.push_back(index);
  Signal();
}

void FakeCamera::Paint(Buffer& buffer, TimePoint read_from, Duration exposure) {
  const int bits = FakeBits(fourcc_);
  v4l2_format format = {};
  FillFormat(&format);
  const size_t line_bytes = format.fmt.pix.bytesperline;
  std::fill(buffer.memory.begin(), buffer.memory.end(), std::byte{0xee});  // padding is seen
  std::vector<unsigned> levels;                                            // of the rows
  for (int y = 0; y < height_; ++y) {
    const TimePoint row_read = read_from + setup_.readout * y / height_;
    const bool dark =
        setup_.pattern || (setup_.composes && static_cast<uint32_t>(y) >= composed_[1]);
    const double light = dark ? 0 : Light(row_read - exposure, row_read);
    levels.push_back(static_cast<unsigned>(std::lround(light * 0.75 * ((1 << bits) - 1))));
  }
  const int left = crop_[0], top = crop_[1];
  const auto sample = [&](int x, int y, int c) {
    return setup_.pattern ? FakeSample(x + left, y + top, c, bits) : levels[y];
  };
  if (setup_.compress) {
    const std::vector<uint8_t> picture = setup_.compress(width_, height_, sample);
    std::memcpy(buffer.memory.data(), picture.data(), picture.size());
    buffer.used = static_cast<uint32_t>(picture.size());
    return;
  }
  size_t used = 0;
  for (int y = 0; y < height_; ++y) {
    const std::vector<uint8_t> line =
        PackLine(fourcc_, width_, [&](int x, int c) { return sample(x, y, c); });
    std::memcpy(buffer.memory.data() + y * line_bytes, line.data(), line.size());
    used = y * line_bytes + line.size();
  }
  buffer.used = static_cast<uint32_t>(used);
}

}  // namespace lightstage
