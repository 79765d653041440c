#include "drivers/conformance/null_devices.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_format.h"

namespace lightstage {
namespace {

using std::chrono::hours;
using std::chrono::nanoseconds;

DeviceIdentity NullIdentity(std::string name) { return {std::move(name), "null", "null", ""}; }

}  // namespace

// ---- NullCamera

NullCamera::NullCamera(Clock& clock, int width, int height) : clock_(clock) {
  info_.identity = NullIdentity("camera");
  info_.sensor_width = width;
  info_.sensor_height = height;
  info_.formats = {PixelFormat::kMono8, PixelFormat::kMono16, PixelFormat::kBayerRG16,
                   PixelFormat::kRGB8};
  info_.min_exposure = nanoseconds(1);
  info_.max_exposure = hours(1);
  info_.exposure_step = nanoseconds(1);
  config_ = {info_.formats.front(), width, height, 0};
}

ConfigResult NullCamera::Validate(const CameraConfig& config) const {
  ConfigResult result{ConfigVerdict::kValid, config, {}};
  if (std::find(info_.formats.begin(), info_.formats.end(), config.format) == info_.formats.end()) {
    result.notes.push_back(
        absl::StrCat("format: ", PixelFormatName(config.format), " is not offered"));
  }
  if (config.width < 1 || config.width > info_.sensor_width || config.height < 1 ||
      config.height > info_.sensor_height) {
    result.notes.push_back(absl::StrFormat("size: %dx%d, must lie in [1, %d] x [1, %d]",
                                           config.width, config.height, info_.sensor_width,
                                           info_.sensor_height));
  }
  if (config.gain_db != 0) {
    result.notes.push_back(absl::StrFormat("gain_db: %g, must be 0", config.gain_db));
  }
  if (!result.notes.empty()) result.verdict = ConfigVerdict::kInvalid;
  return result;
}

ExposureResult NullCamera::ValidateExposure(Duration exposure) const {
  if (exposure >= info_.min_exposure && exposure <= info_.max_exposure) {
    return {ConfigVerdict::kValid, exposure, ""};
  }
  return {ConfigVerdict::kInvalid, exposure,
          absl::StrFormat("exposure: %g s, must lie in [1e-9, 3600] s", Seconds(exposure))};
}

void NullCamera::Configure(const CameraConfig& config, TimePoint, Completion<CameraConfig> done) {
  if (armed_) {
    return std::move(done)(Error(absl::StatusCode::kFailedPrecondition, "CAMERA_ARMED",
                                 "camera: can not be configured while armed"));
  }
  if (ConfigResult result = Validate(config); result.verdict != ConfigVerdict::kValid) {
    return std::move(done)(Error(absl::StatusCode::kInvalidArgument, "CAMERA_CONFIG",
                                 absl::StrCat("camera: ", result.notes.front())));
  }
  {
    MutexLock lock(&mutex_);
    config_ = config;
  }
  std::move(done)(config);
}

void NullCamera::Arm(TimePoint, Completion<CameraConfig> done) {
  CameraConfig config;
  {
    MutexLock lock(&mutex_);
    config = config_;
  }
  armed_ = true;
  std::move(done)(config);
}

void NullCamera::Trigger(Duration exposure, TimePoint, Completion<ExposureEnd> exposure_ended,
                         Completion<Frame> frame_ready) {
  absl::Status refusal;
  if (!armed_) {
    refusal = Error(absl::StatusCode::kFailedPrecondition, "CAMERA_NOT_ARMED",
                    "camera: must be armed before it is triggered");
  } else if (ExposureResult result = ValidateExposure(exposure);
             result.verdict != ConfigVerdict::kValid) {
    refusal = Error(absl::StatusCode::kOutOfRange, "EXPOSURE_RANGE",
                    absl::StrCat("camera: ", result.note));
  }
  if (!refusal.ok()) {
    std::move(exposure_ended)(refusal);
    std::move(frame_ready)(refusal);
    return;
  }
  Frame frame;
  {
    MutexLock lock(&mutex_);
    frame.format = config_.format;
    frame.width = config_.width;
    frame.height = config_.height;
  }
  frame.significant_bits = 8 * BytesPerSample(frame.format);
  frame.data.resize(static_cast<size_t>(frame.width) * frame.height *
                    SamplesPerPixel(frame.format) * BytesPerSample(frame.format));
  frame.exposure = exposure;
  frame.exposure_start = frame.exposure_end = clock_.Now();
  frame.device_timestamp_ns = frame.exposure_start.time_since_epoch().count();
  frame.sequence = ++sequence_;
  std::move(exposure_ended)(ExposureEnd{frame.exposure_end});
  std::move(frame_ready)(std::move(frame));
}

void NullCamera::Disarm(TimePoint, Completion<CameraConfig> done) {
  CameraConfig config;
  {
    MutexLock lock(&mutex_);
    config = config_;
  }
  armed_ = false;
  std::move(done)(config);
}

// ---- NullAxis

NullAxis::NullAxis(AxisInfo info) : info_(std::move(info)) {}

AxisState NullAxis::State() const {
  MutexLock lock(&mutex_);
  return state_;
}

void NullAxis::Home(TimePoint, Completion<AxisState> done) {
  {
    MutexLock lock(&mutex_);
    state_.homed = true;
    state_.position = info_.continuous ? Degrees(0) : std::clamp(Degrees(0), info_.min, info_.max);
  }
  std::move(done)(State());
}

void NullAxis::Move(Angle target, double, TimePoint, Completion<AxisState> done) {
  if (absl::Status inside = CheckTarget(info_, target); !inside.ok()) {
    return std::move(done)(inside);
  }
  {
    MutexLock lock(&mutex_);
    if (state_.homed) state_.position = target;
  }
  AxisState state = State();
  if (!state.homed) {
    return std::move(done)(Error(absl::StatusCode::kFailedPrecondition, "NOT_HOMED",
                                 absl::StrCat(info_.identity.name, ": must be homed before a move"),
                                 {{"axis", info_.identity.name}}));
  }
  std::move(done)(state);
}

void NullAxis::Turn(double velocity_dps, TimePoint, Completion<AxisState> done) {
  absl::Status good = CheckTurn(info_, velocity_dps);
  if (good.ok()) {
    good = Error(absl::StatusCode::kUnimplemented, "CANNOT_TURN",
                 absl::StrCat(info_.identity.name, ": moves in no time"));
  }
  std::move(done)(good);
}

void NullAxis::Read(TimePoint, Completion<AxisState> done) { std::move(done)(State()); }

void NullAxis::Stop(TimePoint, Completion<AxisState> done) { std::move(done)(State()); }

// ---- NullLamps

NullLamps::NullLamps(int count) {
  info_.identity = NullIdentity("lamps");
  info_.count = count;
}

void NullLamps::Set(const std::vector<float>& levels, TimePoint, Completion<LampsState> done) {
  if (absl::Status good = CheckLevels(info_, levels); !good.ok()) {
    return std::move(done)(good);
  }
  std::move(done)(LampsState{levels});
}

void NullLamps::Dark(TimePoint, Completion<LampsState> done) {
  std::move(done)(LampsState{std::vector<float>(info_.count, 0.0f)});
}

absl::Status NullLamps::SetTimeToDark(Duration time) {
  if (time == Duration::zero()) return absl::OkStatus();
  return Error(absl::StatusCode::kOutOfRange, "TIME_TO_DARK", "lamps: have no time-to-dark");
}

// ---- NullProjector

NullProjector::NullProjector(int width, int height) {
  info_.identity = NullIdentity("projector");
  info_.width = width;
  info_.height = height;
}

void NullProjector::Show(const Pattern& pattern, TimePoint, Completion<ProjectorState> done) {
  std::move(done)(ProjectorState{pattern});
}

void NullProjector::Black(TimePoint, Completion<ProjectorState> done) {
  std::move(done)(ProjectorState{});
}

}  // namespace lightstage
