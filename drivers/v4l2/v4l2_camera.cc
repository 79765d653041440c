#include "drivers/v4l2/v4l2_camera.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "absl/strings/str_format.h"

namespace lightstage {
namespace {

using std::chrono::milliseconds;

// How long a wait for a frame may hold up the device's other tasks if waking it fails, and the least time between looks at a camera
// that sends nothing: a camera that is gone is noticed after it at the latest.
constexpr Duration kLook = milliseconds(100);
// Without a frame for so long the stream counts as silent.
constexpr Duration kSilence = milliseconds(1000), kSilenceAfterMiss = milliseconds(100);
// Frames that are passed over when a stream begins; two, for the time between them.
constexpr int kWarmUpFrames = 2;

}  // namespace

absl::StatusOr<std::unique_ptr<Camera>> V4l2Camera::Open(VideoSystem& system,
                                                         const V4l2Options& options,
                                                         const DeviceContext& context) {
  RETURN_IF_ERROR(DeviceThread::CheckClock(context));
  std::unique_ptr<V4l2Camera> camera(new V4l2Camera(system, options, context));
  V4l2Camera* const self = camera.get();
  RETURN_IF_ERROR(self->thread_.Call([self]() -> absl::Status {
    ASSIGN_OR_RETURN(self->link_,
                     V4l2Link::Open(self->system_, self->options_, self->name_, nullptr));
    return absl::OkStatus();
  }));
  camera->capabilities_ = camera->link_->capabilities();
  const V4l2Capabilities& caps = camera->capabilities_;
  CameraInfo& info = camera->info_;
  info.identity = {context.name, "v4l2",
                   absl::StrCat(caps.description.card, " (", caps.description.bus_info, ")"), ""};
  info.sensor_width = caps.sensor_width;
  info.sensor_height = caps.sensor_height;
  for (const V4l2Capabilities::Format& f : caps.formats) info.formats.push_back(f.video.format);
  info.min_exposure = caps.MinExposure();
  info.max_exposure = caps.MaxExposure();
  info.exposure_step = caps.exposure ? caps.ExposureOf(caps.exposure->control.step) : Duration{};
  info.min_gain_db = 0;
  info.max_gain_db = caps.MaxGainDb();
  info.readout = options.readout;
  spdlog::info("{}: {} opened, {}x{}", context.name, info.identity.model, info.sensor_width,
               info.sensor_height);
  if (caps.formats.front().video.packing == Packing::kJpeg) {
    spdlog::warn(
        "{}: MJPG is compressed with loss, which is measured as light, and its values are not "
        "linear in the light",
        context.name);
  }
  return std::unique_ptr<Camera>(std::move(camera));
}

V4l2Camera::V4l2Camera(VideoSystem& system, const V4l2Options& options,
                       const DeviceContext& context)
    : StreamingCamera(context), system_(system), options_(options) {}

V4l2Camera::~V4l2Camera() {
  waker_.Wake();
  thread_.Close();
}

// ---- Any thread

ExposureResult V4l2Camera::ValidateExposure(Duration exposure) const {
  return capabilities_.ValidateExposure(exposure, Duration(interval_ns_.load()));
}

absl::Status V4l2Camera::LostError() const {
  return Error(absl::StatusCode::kUnavailable, "DEVICE_LOST",
               absl::StrCat(name_, ": the camera ", info_.identity.model,
                            " is gone; disarm and configure it to connect anew"),
               {{"device", name_}, {"camera", info_.identity.model}});
}

// ---- The device's thread: configuration and stream

absl::Status V4l2Camera::DoConfigure(const CameraConfig& config) {
  configured_ = false;
  settled_ = false;
  if (lost_ || !link_) {
    link_.reset();
    absl::StatusOr<std::unique_ptr<V4l2Link>> link =
        V4l2Link::Open(system_, options_, name_, &capabilities_.description);
    if (absl::IsNotFound(link.status())) return LostError();  // not there yet
    if (!link.ok()) return link.status();
    const V4l2Capabilities& now = (*link)->capabilities();
    if (now.sensor_width != capabilities_.sensor_width ||
        now.sensor_height != capabilities_.sensor_height ||
        now.MinExposure() != capabilities_.MinExposure() ||
        now.MaxExposure() != capabilities_.MaxExposure() ||
        now.formats.size() != capabilities_.formats.size()) {
      return Refusal("DEVICE_UNSUITABLE", absl::StrCat(info_.identity.model,
                                                       " offers other sizes, formats or exposures "
                                                       "than before; open it anew"));
    }
    link_ = *std::move(link);
    lost_ = false;
    spdlog::info("{}: connected anew", name_);
  }
  absl::StatusOr<CameraConfig> configured = link_->Configure(config);
  if (!configured.ok()) {
    if (ErrorReason(configured.status()) == "DEVICE_LOST") OnTrouble(configured.status());
    return configured.status();
  }
  interval_ns_ = stretches() ? 0 : link_->interval().count();
  measured_interval_ = {};
  config_ = *configured;
  configured_ = true;
  return absl::OkStatus();
}

absl::Status V4l2Camera::Begin() {
  counter_.Restart();
  frames_ = 0;
  last_stamp_.reset();
  settled_ = false;
  unsettled_exposure_ = info_.max_exposure;  // whatever it was left with
  absl::Status started = link_->StartStream();
  last_frame_ = last_empty_ = controls_set_ = clock_.Now();
  return started;
}

absl::Status V4l2Camera::DoArm(const Outstanding& operation, TimePoint /*deadline*/) {
  if (lost_ || !link_) return LostError();
  if (!configured_) {
    return Refusal("CAMERA_NOT_CONFIGURED", "must be configured before it is armed");
  }
  active_.reset();
  absl::Status status = Begin();
  // A camera that is armed has shown that it sends frames.
  while (status.ok() && frames_ < kWarmUpFrames && !operation.finished()) {
    const VideoDevice::Readiness readiness = link_->Wait(kLook, waker_.fd());
    waker_.Clear();
    status = TakeAll(readiness);
  }
  if (!status.ok()) {
    OnTrouble(status);
  } else if (operation.finished()) {
    link_->StopStream();  // too late, or disarmed
  } else {
    StartPump();
  }
  return status;
}

ExposureTiming V4l2Camera::Timing() const {
  ExposureTiming timing;
  timing.latency = options_.latency;
  timing.stamps_at_exposure_start = options_.stamps_at_exposure_start;
  // What the camera says and what it does may differ; the longer one is safe.
  timing.interval = std::max(link_->interval(), measured_interval_);
  return timing;
}

// The longest exposure that the next frame may have.
Duration V4l2Camera::PossibleExposure() const {
  if (settled_) return used_exposure_;
  const Duration interval = Timing().interval;
  // Unless the camera may lengthen its frames, no exposure is longer than one.
  const bool bounded = interval > Duration::zero() && !stretches();
  return std::max(used_exposure_,
                  bounded ? std::min(unsettled_exposure_, interval) : unsettled_exposure_);
}

bool V4l2Camera::Silent() const {
  const Duration silence = clock_.Now() - last_frame_;
  const Duration interval = std::max(Timing().interval, used_exposure_);
  return silence > std::max(kSilence, 5 * interval) ||
         (active_ != nullptr && silence > std::max(kSilenceAfterMiss, 3 * interval));
}

absl::Status V4l2Camera::SetExposure(Duration exposure) {
  bool changed = false;
  const absl::StatusOr<Duration> used = link_->SetExposure(exposure, &changed);
  if (changed) {
    unsettled_exposure_ = settled_ ? used_exposure_ : std::max(unsettled_exposure_, used_exposure_);
    settled_ = false;
    controls_set_ = clock_.Now();
  }
  if (!used.ok()) return used.status();
  used_exposure_ = *used;
  return absl::OkStatus();
}

void V4l2Camera::DoDisarm() {
  if (link_) link_->StopStream();
  active_.reset();
}

void V4l2Camera::DoTrigger(const std::shared_ptr<CameraShot>& shot) {
  if (shot->finished()) return;
  if (lost_ || !link_) {
    shot->Fail(LostError());
    return;
  }
  if (!link_->streaming() || Silent()) {
    spdlog::warn("{}: starting the stream anew, for it had {}", name_,
                 link_->streaming() ? "gone silent" : "ended");
    if (absl::Status status = Begin(); !status.ok()) {
      active_ = shot;
      OnTrouble(status);
      return;
    }
  }
  active_.reset();
  if (absl::Status status = SetExposure(shot->exposure); !status.ok()) {
    if (ErrorReason(status) == "DEVICE_LOST") OnTrouble(status);
    shot->Fail(status);
    return;
  }
  active_ = shot;
  active_->used_exposure = used_exposure_;
  TimePoint lit = shot->sent;
  int skip = options_.latency ? 0 : 1;
  if (!settled_) {
    lit = std::max(lit, controls_set_);
    skip += options_.control_delay_frames;
  }
  choice_ = FrameChoice(lit, skip);
  StartPump();
}

// ---- The device's thread: frames

void V4l2Camera::StartPump() {
  if (std::exchange(pumping_, true)) return;
  thread_.Post([this] { Pump(); });
}

// A frame whose stamp is not believed counts only if there was none yet when the last light from before the trigger can have been
// gathered: one look is due just then, else it would take the frame after the next.
Duration V4l2Camera::UntilLook() const {
  if (!active_) return kLook;
  const ExposureTiming timing = Timing();
  const TimePoint due =
      choice_.lit() + PossibleExposure() + timing.latency.value_or(timing.interval);
  if (last_empty_ >= due) return kLook;
  return std::clamp<Duration>(due - clock_.Now(), Duration::zero(), kLook);
}

// One look; goes behind the tasks that were posted meanwhile.
void V4l2Camera::Pump() {
  if (!link_ || !link_->streaming()) {
    pumping_ = false;
    return;
  }
  const VideoDevice::Readiness readiness = link_->Wait(UntilLook(), waker_.fd());
  waker_.Clear();
  if (absl::Status status = TakeAll(readiness); !status.ok()) OnTrouble(status);
  thread_.Post([this] { Pump(); });
}

absl::Status V4l2Camera::TakeAll(VideoDevice::Readiness readiness) {
  for (bool first = true;; first = false) {
    const TimePoint before = clock_.Now();
    ASSIGN_OR_RETURN(const std::optional<V4l2Link::Taken> taken, link_->Take());
    if (!taken) {
      last_empty_ = before;
      if (!first || readiness != VideoDevice::Readiness::kError) return absl::OkStatus();
      return Refusal("DEVICE_FAULT", "the kernel says that the stream is broken");
    }
    RETURN_IF_ERROR(OnFrame(*taken));
  }
}

absl::Status V4l2Camera::OnFrame(const V4l2Link::Taken& taken) {
  // uvcvideo gives all buffers back when a transfer failed, and may not ask for more: there was no frame that could count as one.
  if (taken.damaged && taken.bytes.empty()) {
    return Refusal("DEVICE_FAULT", "the kernel gave a buffer back without a frame");
  }
  FrameStamp stamp;
  stamp.stamp = taken.stamp;
  stamp.flagged_start_of_exposure = taken.flagged_start_of_exposure;
  stamp.not_before = last_empty_;
  stamp.dequeued = clock_.Now();
  const FrameCounter::Step step = counter_.Next(taken.sequence);
  if (taken.stamp && last_stamp_ && !step.backwards && *taken.stamp > *last_stamp_) {
    measured_interval_ = (*taken.stamp - *last_stamp_) / (1 + int64_t{step.skipped});
  }
  last_stamp_ = taken.stamp;
  last_frame_ = stamp.dequeued;
  skipped_ += step.skipped;
  ++frames_;
  if (active_ && active_->finished()) active_.reset();
  if (!active_) return link_->GiveBack(taken);

  if (step.backwards) {
    RETURN_IF_ERROR(link_->GiveBack(taken));
    std::exchange(active_, nullptr)
        ->Fail(Error(absl::StatusCode::kDataLoss, "FRAME_INCOMPLETE",
                     absl::StrFormat("%s: frame number %d came after a later one or twice", name_,
                                     taken.sequence),
                     {{"device", name_}, {"frame", absl::StrCat(taken.sequence)}}));
    return absl::OkStatus();
  }
  if (!choice_.Counts(EarliestLight(stamp, PossibleExposure(), Timing()))) {
    return link_->GiveBack(taken);
  }
  settled_ = true;
  return Deliver(taken, stamp, step.sequence);
}

absl::Status V4l2Camera::Deliver(const V4l2Link::Taken& taken, const FrameStamp& stamp,
                                 uint64_t sequence) {
  const std::shared_ptr<CameraShot> shot = std::exchange(active_, nullptr);
  if (stamp.dequeued > shot->deadline) {
    shot->Fail(thread_.Late("the frame"));  // its timer has not come to it yet
    return link_->GiveBack(taken);
  }
  if (!taken.damaged) shot->EndExposure(stamp.dequeued);
  absl::StatusOr<Frame> frame = link_->Decode(taken);
  absl::Status returned = link_->GiveBack(taken);
  if (frame.ok()) {
    frame->sequence = sequence;
    frame->exposure = shot->used_exposure;
    frame->exposure_end = LikelyExposureEnd(stamp, shot->used_exposure, Timing());
    frame->exposure_start = frame->exposure_end - shot->used_exposure;
    frame->latest_start = LatestStart(stamp, shot->used_exposure, Timing());
    if (skipped_ > 0) {
      spdlog::warn("{}: {} frames of the camera never came since the last shot", name_, skipped_);
    }
    skipped_ = 0;
  }
  shot->Finish(std::move(frame));
  return returned;
}

void V4l2Camera::OnTrouble(const absl::Status& trouble) {
  if (ErrorReason(trouble) != "DEVICE_LOST") {
    spdlog::warn("{}: the stream has ended: {}", name_, MessageOf(trouble));
    link_->StopStream();
    if (active_) std::exchange(active_, nullptr)->Fail(trouble);
    return;
  }
  lost_ = true;
  spdlog::warn("{}: the camera is gone: {}", name_, MessageOf(trouble));
  active_.reset();
  link_.reset();  // before the completions: they may find it plugged in again
  thread_.FailAll(LostError());
}

}  // namespace lightstage
