#include "drivers/aravis/aravis_camera.h"

#include <spdlog/spdlog.h>

#include <algorithm>

#include "absl/strings/str_format.h"

namespace lightstage {
namespace {

// libaravis repeats a command that is not acknowledged within 500 ms: one that took so long may have triggered twice.
constexpr Duration kRepeatedCommand = std::chrono::milliseconds(400);

}  // namespace

absl::StatusOr<std::unique_ptr<Camera>> AravisCamera::Open(const AravisOptions& options,
                                                           const DeviceContext& context) {
  RETURN_IF_ERROR(DeviceThread::CheckClock(context));
  std::unique_ptr<AravisCamera> camera(new AravisCamera(options, context));
  ASSIGN_OR_RETURN(camera->link_, camera->Connect());
  camera->capabilities_ = camera->link_->capabilities();
  const AravisCapabilities& caps = camera->capabilities_;
  CameraInfo& info = camera->info_;
  info.identity = {context.name, "aravis", absl::StrCat(caps.vendor, " ", caps.model), caps.serial};
  info.sensor_width = caps.width.max;
  info.sensor_height = caps.height.max;
  for (const GenicamFormat& f : caps.formats) info.formats.push_back(f.format);
  info.min_exposure = caps.min_exposure;
  info.max_exposure = caps.max_exposure;
  info.exposure_step = caps.exposure_step;
  info.min_gain_db = caps.MinGainDb();
  info.max_gain_db = caps.MaxGainDb();
  info.readout = options.readout;
  spdlog::info("{}: {} {} opened, {}x{}", context.name, info.identity.model, info.identity.serial,
               info.sensor_width, info.sensor_height);
  return std::unique_ptr<Camera>(std::move(camera));
}

AravisCamera::AravisCamera(const AravisOptions& options, const DeviceContext& context)
    : StreamingCamera(context), options_(options) {}

AravisCamera::~AravisCamera() {
  thread_.Close();
  link_.reset();  // its threads use what follows
}

absl::StatusOr<std::unique_ptr<AravisLink>> AravisCamera::Connect() {
  AravisLink::Events events;
  events.first_packet = [this](uint64_t session, TimePoint time) {
    thread_.Post([this, session, time] { OnFirstPacket(session, time); });
  };
  events.buffer_done = [this](uint64_t session) {
    thread_.Post([this, session] { OnBuffer(session); });
  };
  events.exposure_ended = [this](uint64_t frame_id, TimePoint time) {
    thread_.Post([this, frame_id, time] { OnExposureEnded(frame_id, time); });
  };
  events.lost = [this](const std::string& why) { OnLost(why); };
  return AravisLink::Open(options_, name_, clock_, std::move(events));
}

// ---- Any thread

absl::Status AravisCamera::LostError() const {
  MutexLock lock(&lost_mutex_);
  return Error(
      absl::StatusCode::kUnavailable, "DEVICE_LOST",
      absl::StrCat(name_, ": the camera is lost: ", lost_, "; arm or configure it to connect anew"),
      {{"device", name_}, {"detail", lost_}});
}

bool AravisCamera::lost() const {
  MutexLock lock(&lost_mutex_);
  return !lost_.empty();
}

void AravisCamera::OnLost(const std::string& why) {
  {
    MutexLock lock(&lost_mutex_);
    if (!lost_.empty()) return;  // libaravis notices too
    lost_ = why;
  }
  spdlog::warn("{}: lost: {}", name_, why);
  thread_.FailAll(LostError());
}

// ---- The device's thread

absl::Status AravisCamera::ConnectAnew() {
  streaming_ = false;
  active_.reset();
  link_.reset();
  sequence_base_ = last_sequence_;
  {
    MutexLock lock(&lost_mutex_);
    lost_.clear();  // before: it may get lost again at once
  }
  absl::StatusOr<std::unique_ptr<AravisLink>> link = Connect();
  if (link.ok()) link = TheSame(*std::move(link));
  if (!link.ok()) {
    MutexLock lock(&lost_mutex_);
    lost_ = MessageOf(link.status());
    return link.status();
  }
  link_ = *std::move(link);
  spdlog::info("{}: connected anew", name_);
  return absl::OkStatus();
}

absl::StatusOr<std::unique_ptr<AravisLink>> AravisCamera::TheSame(
    std::unique_ptr<AravisLink> link) const {
  const AravisCapabilities& now = link->capabilities();
  if (now.serial == capabilities_.serial && now.width.max == capabilities_.width.max &&
      now.height.max == capabilities_.height.max) {
    return link;
  }
  return Error(absl::StatusCode::kFailedPrecondition, "DEVICE_UNSUITABLE",
               absl::StrFormat("%s: another camera answers now: serial '%s' instead of '%s'", name_,
                               now.serial, capabilities_.serial),
               {{"device", name_}, {"serial", now.serial}});
}

absl::Status AravisCamera::DoConfigure(const CameraConfig& config) {
  asked_ = config;
  configured_ = false;
  if (lost()) RETURN_IF_ERROR(ConnectAnew());
  ASSIGN_OR_RETURN(config_, link_->Configure(config));
  configured_ = true;
  return absl::OkStatus();
}

absl::Status AravisCamera::DoArm(const Outstanding& operation, TimePoint deadline) {
  if (lost() && asked_) {
    RETURN_IF_ERROR(DoConfigure(CameraConfig(*asked_)));
    if (operation.finished()) return thread_.Late("Arm");
  }
  return StartStream(deadline);
}

absl::Status AravisCamera::StartStream(TimePoint deadline) {
  if (lost()) return LostError();
  if (!configured_) {
    return Refusal("CAMERA_NOT_CONFIGURED", "must be configured before it is armed");
  }
  streaming_ = false;
  active_.reset();
  absl::Status started = link_->StartStream(config_, deadline);
  if (!started.ok()) {
    link_->StopStream();
    return started;
  }
  streaming_ = true;
  out_of_step_ = false;
  return absl::OkStatus();
}

void AravisCamera::DoDisarm() {
  if (link_) link_->StopStream();
  streaming_ = false;
  active_.reset();
}

void AravisCamera::DoTrigger(const std::shared_ptr<CameraShot>& shot) {
  if (shot->finished()) return;
  if (lost()) {
    shot->Fail(LostError());
    return;
  }
  // A trigger whose frame never came: it may still come, and must not be taken for this one's.
  if (active_) out_of_step_ = true;
  if (out_of_step_ || !streaming_) {
    spdlog::warn("{}: starting the stream anew after a stray or missing frame", name_);
    if (absl::Status status = StartStream(shot->deadline); !status.ok()) {
      shot->Fail(status);
      return;
    }
  }
  absl::StatusOr<Duration> used = link_->SetExposure(shot->exposure);
  if (!used.ok()) {
    shot->Fail(used.status());
    return;
  }
  if (shot->finished()) return;  // too late, or disarmed meanwhile
  shot->used_exposure = *used;
  active_ = shot;
  told_end_.reset();
  shot->sent = clock_.Now();
  if (absl::Status status = link_->Trigger(); !status.ok()) {
    shot->Fail(status);  // stays active: the camera may have got it
    return;
  }
  shot->acknowledged = clock_.Now();
  if (shot->acknowledged - shot->sent > kRepeatedCommand) out_of_step_ = true;
  if (options_.exposure_end_margin) {
    TimePoint end = shot->acknowledged + shot->used_exposure + *options_.exposure_end_margin;
    std::weak_ptr<CameraShot> weak = shot;
    clock_.At(end, [weak, end] {
      if (std::shared_ptr<CameraShot> s = weak.lock()) s->EndExposure(end);
    });
  }
}

void AravisCamera::OnFirstPacket(uint64_t session, TimePoint time) {
  if (!streaming_ || session != link_->session()) return;
  // A stray frame's packets are sorted out when the frame is taken.
  if (active_ && CanBeOver(*active_, time)) active_->EndExposure(time);
}

void AravisCamera::OnExposureEnded(uint64_t frame_id, TimePoint time) {
  // An earlier frame's event may be sent again while this one is exposed.
  if (!streaming_ || !active_ || told_end_.has_value() || frame_id != link_->next_frame_id() ||
      !CanBeOver(*active_, time)) {
    return;
  }
  told_end_ = time;
  active_->EndExposure(time);
}

// Some cameras send the head of a frame when they begin to expose it: that says nothing of the end.
bool AravisCamera::CanBeOver(const CameraShot& shot, TimePoint time) {
  return time >= shot.sent + shot.used_exposure;
}

void AravisCamera::OnBuffer(uint64_t session) {
  if (!streaming_ || session != link_->session()) return;
  while (std::optional<AravisLink::Taken> taken = link_->TakeBuffer()) {
    if (!active_ || taken->first_packet < active_->sent) {
      out_of_step_ = true;
      continue;
    }
    FinishActive(*std::move(taken));
  }
}

void AravisCamera::FinishActive(AravisLink::Taken taken) {
  std::shared_ptr<CameraShot> shot = std::move(active_);
  active_.reset();
  if (absl::Status status = link_->Triggered(); !status.ok()) {
    spdlog::warn("{}", MessageOf(status));
    out_of_step_ = true;
  }
  if (clock_.Now() > shot->deadline) {
    shot->Fail(thread_.Late("the frame"));  // its timer has not come to it yet
    return;
  }
  absl::StatusOr<Frame> frame = std::move(taken.frame);
  if (frame.ok()) {
    last_sequence_ = frame->sequence += sequence_base_;
    const TimePoint over = told_end_.value_or(
        CanBeOver(*shot, taken.first_packet) ? taken.first_packet : clock_.Now());
    // By software: triggered between sent and acknowledged. A line has its own time.
    const TimePoint start = shot->sent + (shot->acknowledged - shot->sent) / 2;
    frame->exposure_end =
        options_.SoftwareTriggered() ? std::min(start + shot->used_exposure, over) : over;
    frame->exposure_start = frame->exposure_end - frame->exposure;
    shot->EndExposure(over);
  }
  shot->Finish(std::move(frame));
}

}  // namespace lightstage
