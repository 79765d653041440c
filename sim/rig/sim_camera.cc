#include "sim/rig/sim_camera.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "absl/strings/str_format.h"

namespace lightstage::sim {
namespace {

constexpr Duration kExposureStep = std::chrono::microseconds(1);

CameraInfo InfoOf(const std::string& name, const SimCameraOptions& options, const World& world) {
  CameraInfo info;
  info.identity = {.name = name, .driver = "sim", .model = "lightstaged simulated camera"};
  info.sensor_width = options.width;
  info.sensor_height = options.height;
  for (int f = 0; f <= static_cast<int>(PixelFormat::kRGB16); ++f) {
    info.formats.push_back(static_cast<PixelFormat>(f));
  }
  info.min_exposure = options.min_exposure;
  info.max_exposure = options.max_exposure;
  info.exposure_step = kExposureStep;
  info.max_gain_db = options.max_gain_db;
  info.readout = options.readout + world.RowLag(options.height);
  return info;
}

// The centred region of interest of a whole frame. Its corner is even, so that a Bayer mosaic keeps its phase.
std::vector<std::byte> Crop(const std::vector<std::byte>& data, FilmSize chip,
                            const CameraConfig& config) {
  const size_t pixel =
      static_cast<size_t>(BytesPerSample(config.format)) * SamplesPerPixel(config.format);
  const int left = (chip.width - config.width) / 4 * 2, top = (chip.height - config.height) / 4 * 2;
  std::vector<std::byte> out(pixel * config.width * config.height);
  for (int y = 0; y < config.height; ++y) {
    std::memcpy(out.data() + pixel * config.width * y,
                data.data() + pixel * (static_cast<size_t>(chip.width) * (top + y) + left),
                pixel * config.width);
  }
  return out;
}

absl::Status Refused(const std::string& name, std::string_view reason, std::string_view why) {
  return Error(absl::StatusCode::kFailedPrecondition, reason, absl::StrCat(name, ": ", why),
               {{"device", name}});
}

}  // namespace

SimCamera::SimCamera(const std::string& name, const SimCameraOptions& options,
                     std::shared_ptr<World> world)
    : options_(options),
      info_(InfoOf(name, options, *world)),
      world_(std::move(world)),
      opened_(world_->clock().Now()),
      timers_(world_->clock()),
      config_{PixelFormat::kMono8, options.width, options.height, 0} {
  if (timers_.clock().is_virtual()) return;
  worker_ = std::thread([this] {
    while (auto job = work_.Pop()) std::move (*job)();
  });
}

SimCamera::~SimCamera() {
  timers_.Close();
  work_.Close();
  if (worker_.joinable()) worker_.join();
  Abort(0,
        Error(absl::StatusCode::kCancelled, "DEVICE_CLOSED",
              absl::StrCat(info_.identity.name, " was closed"), {{"device", info_.identity.name}}));
}

// ---- Settings

ConfigResult SimCamera::Validate(const CameraConfig& config) const {
  ConfigResult result{ConfigVerdict::kValid, config, {}};
  auto invalid = [&](std::string note) {
    result.verdict = ConfigVerdict::kInvalid;
    result.notes.push_back(std::move(note));
  };
  auto adjust = [&](const char* field, auto& value, auto real) {
    if (value == real) return;
    result.notes.push_back(absl::StrCat(field, ": asked ", value, ", real ", real));
    value = real;
    if (result.verdict == ConfigVerdict::kValid) result.verdict = ConfigVerdict::kAdjusted;
  };
  const int step = IsBayer(config.format) ? 2 : 1;  // whole cells of the mosaic
  if (config.width < 1 || config.height < 1) {
    invalid(absl::StrFormat("size: asked %d x %d, must be from 1 x 1 to %d x %d", config.width,
                            config.height, options_.width, options_.height));
  } else {
    adjust("width", result.config.width,
           std::clamp(config.width / step * step, step, options_.width));
    adjust("height", result.config.height,
           std::clamp(config.height / step * step, step, options_.height));
  }
  if (!std::isfinite(config.gain_db)) {
    invalid(
        absl::StrCat("gain_db: asked ", config.gain_db, ", must be from 0 to ", info_.max_gain_db));
  } else {
    adjust("gain_db", result.config.gain_db, std::clamp(config.gain_db, 0.0, info_.max_gain_db));
  }
  return result;
}

ExposureResult SimCamera::ValidateExposure(Duration exposure) const {
  if (exposure <= Duration::zero()) {
    return {
        ConfigVerdict::kInvalid, Duration::zero(),
        absl::StrFormat("exposure: asked %g us, must be from %g to %g us", Seconds(exposure) * 1e6,
                        Seconds(info_.min_exposure) * 1e6, Seconds(info_.max_exposure) * 1e6)};
  }
  Duration real = std::clamp(exposure, info_.min_exposure, info_.max_exposure);
  real = std::max(info_.min_exposure, real / kExposureStep * kExposureStep);
  if (real == exposure) return {ConfigVerdict::kValid, real, ""};
  return {ConfigVerdict::kAdjusted, real,
          absl::StrFormat("exposure: asked %g us, real %g us", Seconds(exposure) * 1e6,
                          Seconds(real) * 1e6)};
}

void SimCamera::Configure(const CameraConfig& config, TimePoint, Completion<CameraConfig> done) {
  const ConfigResult verdict = Validate(config);
  absl::StatusOr<CameraConfig> result = config;
  if (verdict.verdict != ConfigVerdict::kValid) {
    result = Error(absl::StatusCode::kInvalidArgument, "CAMERA_CONFIG",
                   absl::StrCat(info_.identity.name, ": ", verdict.notes.front()),
                   {{"device", info_.identity.name}, {"note", verdict.notes.front()}});
  } else {
    MutexLock lock(&mutex_);
    if (armed_) {
      result = Refused(info_.identity.name, "CAMERA_ARMED", "disarm it before configuring it");
    } else {
      config_ = config;
    }
  }
  std::move(done)(std::move(result));
}

void SimCamera::Arm(TimePoint, Completion<CameraConfig> done) {
  CameraConfig config;
  {
    MutexLock lock(&mutex_);
    armed_ = true;
    config = config_;
  }
  std::move(done)(config);
}

void SimCamera::Disarm(TimePoint, Completion<CameraConfig> done) {
  CameraConfig config;
  {
    MutexLock lock(&mutex_);
    armed_ = false;
    config = config_;
  }
  Abort(0, Error(absl::StatusCode::kCancelled, "DISARMED",
                 absl::StrCat(info_.identity.name, " was disarmed"),
                 {{"device", info_.identity.name}}));
  std::move(done)(config);
}

// ---- Exposures

void SimCamera::Trigger(Duration exposure, TimePoint deadline,
                        Completion<ExposureEnd> exposure_ended, Completion<Frame> frame_ready) {
  const ExposureResult checked = ValidateExposure(exposure);
  absl::Status refused;
  if (checked.verdict == ConfigVerdict::kInvalid) {
    refused = Error(absl::StatusCode::kInvalidArgument, "CAMERA_EXPOSURE",
                    absl::StrCat(info_.identity.name, ": ", checked.note),
                    {{"device", info_.identity.name}, {"note", checked.note}});
  } else {
    MutexLock lock(&mutex_);
    if (!armed_) {
      refused = Refused(info_.identity.name, "CAMERA_NOT_ARMED", "arm it before triggering it");
    } else if (shot_) {
      refused = Refused(info_.identity.name, "CAMERA_BUSY", "its last frame is not ready yet");
    } else {
      const TimePoint now = timers_.clock().Now(), end = now + checked.exposure;
      // Light may change when the last row has seen enough.
      const TimePoint closed = end + world_->RowLag(options_.height);
      const uint64_t number = ++shots_;
      const bool silent = world_->FaultDue(Operation::kTrigger);
      Shot shot;
      shot.number = number;
      shot.start = now;
      shot.end = end;
      shot.config = config_;
      shot.ended = std::move(exposure_ended);
      shot.ready = std::move(frame_ready);
      if (!silent) {
        shot.timers = {timers_.At(closed, [this, number] { ExposureEnded(number); }),
                       timers_.At(closed + options_.readout, [this, number] { ReadOut(number); })};
      }
      shot.timers.push_back(timers_.At(deadline, [this, number] {
        Abort(number, Error(absl::StatusCode::kDeadlineExceeded, "DEVICE_SILENT",
                            absl::StrCat(info_.identity.name, " did not deliver its frame in time"),
                            {{"device", info_.identity.name}}));
      }));
      shot_ = std::move(shot);
    }
  }
  if (!refused.ok()) {
    // Then they have not been moved. NOLINTBEGIN(bugprone-use-after-move)
    std::move(exposure_ended)(refused);
    std::move(frame_ready)(refused);
    // NOLINTEND(bugprone-use-after-move)
    return;
  }
  // Tracing may go on while the sensor gathers light, unless there is work enough.
  if (worker_.joinable() && work_.size() == 0) work_.Push([this] { world_->Prefetch(chip()); });
}

void SimCamera::ExposureEnded(uint64_t number) {
  Completion<ExposureEnd> ended;
  TimePoint end;
  {
    MutexLock lock(&mutex_);
    if (!shot_ || shot_->number != number) return;
    ended = std::move(shot_->ended);
    shot_->ended = nullptr;
    end = shot_->end + world_->RowLag(options_.height);
  }
  if (worker_.joinable()) work_.Push([this, number] { Compute(number); });
  std::move(ended)(ExposureEnd{end});
}

void SimCamera::ReadOut(uint64_t number) {
  if (!worker_.joinable()) Compute(number);
  {
    MutexLock lock(&mutex_);
    if (!shot_ || shot_->number != number) return;
    shot_->read_out = true;
  }
  DeliverIfComplete(number);
}

void SimCamera::Compute(uint64_t number) {
  TimePoint start, end;
  CameraConfig config;
  {
    MutexLock lock(&mutex_);
    if (!shot_ || shot_->number != number) return;
    start = shot_->start;
    end = shot_->end;
    config = shot_->config;
  }
  absl::StatusOr<Frame> frame = TakePicture(config, start, end, number);
  {
    MutexLock lock(&mutex_);
    if (!shot_ || shot_->number != number) return;
    shot_->frame = std::move(frame);
  }
  DeliverIfComplete(number);
}

void SimCamera::DeliverIfComplete(uint64_t number) {
  std::optional<Shot> shot;
  {
    MutexLock lock(&mutex_);
    if (!shot_ || shot_->number != number || !shot_->read_out || !shot_->frame) return;
    shot.swap(shot_);
  }
  for (uint64_t timer : shot->timers) timers_.Cancel(timer);
  std::move(shot->ready)(*std::move(shot->frame));
}

void SimCamera::Abort(uint64_t number, const absl::Status& why) {
  std::optional<Shot> shot;
  {
    MutexLock lock(&mutex_);
    if (!shot_ || (number != 0 && shot_->number != number)) return;
    shot.swap(shot_);
  }
  for (uint64_t timer : shot->timers) timers_.Cancel(timer);
  if (shot->ended) std::move(shot->ended)(why);
  std::move(shot->ready)(why);
}

absl::StatusOr<Frame> SimCamera::TakePicture(const CameraConfig& config, TimePoint start,
                                             TimePoint end, uint64_t number) {
  if (world_->FrameLost()) {
    return Error(absl::StatusCode::kDataLoss, "FRAME_INCOMPLETE",
                 absl::StrCat(info_.identity.name, ": frame ", number, " lost data"),
                 {{"device", info_.identity.name}, {"frame", absl::StrCat(number)}});
  }
  ASSIGN_OR_RETURN(Frame frame, world_->Expose(start, end, config.format, chip(), options_.bits,
                                               config.gain_db));
  if (config.width != options_.width || config.height != options_.height) {
    frame.data = Crop(frame.data, chip(), config);
    frame.width = config.width;
    frame.height = config.height;
  }
  frame.device_timestamp_ns = (end - opened_).count();
  frame.sequence = number;
  return frame;
}

}  // namespace lightstage::sim
