#include "daemon/rpc/rig_service.h"

#include <cmath>

#include "absl/strings/str_format.h"
#include "base/status.h"
#include "base/utf8.h"
#include "base/version.h"
#include "daemon/capture/limits.h"
#include "daemon/develop/develop.h"
#include "daemon/rig/bracket.h"
#include "daemon/rpc/chunks.h"
#include "daemon/rpc/convert.h"
#include "daemon/rpc/errors.h"
#include "daemon/rpc/names.h"
#include "dataset/basis_exr.h"

namespace lightstage::rpc {
namespace {

// Degrees per second; slower is a slip, and would not arrive in anybody's lifetime.
constexpr double kLeastVelocity = 0.01;

// Seconds. Whoever wants more asks again, so that nothing turns for ever that was forgotten.
constexpr double kLongestJog = 3600;

absl::StatusOr<AxisId> FromMessage(v1::AxisId id) {
  if (id == v1::AXIS_ID_TURNTABLE) return AxisId::kTurntable;
  if (id == v1::AXIS_ID_TILT) return AxisId::kTilt;
  return Error(absl::StatusCode::kInvalidArgument, "AXIS_UNKNOWN",
               absl::StrFormat("axis %d: TURNTABLE (1) and TILT (2) are known", id),
               {{"axis", absl::StrCat(id)}});
}

v1::AxisId ToMessage(AxisId id) {
  return id == AxisId::kTurntable ? v1::AXIS_ID_TURNTABLE : v1::AXIS_ID_TILT;
}

v1::AxisState ToMessage(AxisId id, const AxisState& state) {
  v1::AxisState message;
  message.set_axis(ToMessage(id));
  message.set_position_deg(state.position.degrees());
  message.set_velocity_dps(state.velocity_dps);
  message.set_homed(state.homed);
  message.set_moving(state.moving);
  return message;
}

void AddLit(const std::vector<float>& levels,
            google::protobuf::RepeatedPtrField<v1::LampLevel>* lit) {
  for (size_t i = 0; i < levels.size(); ++i) {
    if (levels[i] == 0) continue;  // NaN, a lamp that did not confirm, is shown
    v1::LampLevel* lamp = lit->Add();
    lamp->set_lamp(static_cast<int>(i));
    lamp->set_level(levels[i]);
  }
}

absl::Status LightUnknown(std::string_view device) {
  return Error(
      absl::StatusCode::kFailedPrecondition, "LIGHT_UNKNOWN",
      absl::StrCat(device,
                   " is in an unknown state: it did not confirm its last command, or went dark "
                   "by itself; set all lamps (others_off), or reset the rig"),
      {{"device", std::string(device)}});
}

v1::Device ToMessage(const DeviceIdentity& identity, v1::DeviceKind kind) {
  v1::Device device;
  device.set_name(identity.name);
  device.set_kind(kind);
  device.set_driver(CleanUtf8(identity.driver));
  device.set_model(CleanUtf8(identity.model));
  device.set_serial(CleanUtf8(identity.serial));
  return device;
}

}  // namespace

RigService::RigService(Rig& rig, const RigFacts& facts, Control& control, RunManager& runs)
    : rig_(rig), facts_(facts), control_(control), runs_(runs) {}

// ---- Looking

grpc::Status RigService::GetRig(grpc::ServerContext*, const v1::GetRigRequest*,
                                v1::GetRigResponse* response) {
  v1::Rig& rig = *response->mutable_rig();
  const RigFile& file = rig_.file();
  rig.set_name("rig");
  rig.set_display_name(file.name);
  rig.set_daemon_version(kVersion);
  rig.set_virtual_time(file.virtual_time);
  rig.set_heartbeat_seconds(Seconds(control_.heartbeat()));
  *rig.add_devices() = ToMessage(facts_.camera.identity, v1::DEVICE_KIND_CAMERA);

  for (AxisId id : {AxisId::kTurntable, AxisId::kTilt}) {
    const Axis* axis = rig_.axis(id);
    if (!axis) continue;
    const AxisInfo& info = axis->info();
    *rig.add_devices() = ToMessage(info.identity, v1::DEVICE_KIND_AXIS);
    v1::AxisDescription& description = *rig.add_axes();
    description.set_axis(ToMessage(id));
    bool turntable = id == AxisId::kTurntable;
    const LimitOptions& limits = file.limits;
    Angle lo = turntable ? limits.azimuth_min : limits.tilt_min;
    Angle hi = turntable ? limits.azimuth_max : limits.tilt_max;
    description.set_min_deg((info.continuous ? lo : std::max(lo, info.min)).degrees());
    description.set_max_deg((info.continuous ? hi : std::min(hi, info.max)).degrees());
    description.set_continuous(info.continuous);
    description.set_max_velocity_dps(info.max_velocity_dps);
    description.set_max_acceleration_dps2(info.max_acceleration_dps2);
  }

  v1::CameraDescription& camera = *rig.mutable_camera();
  camera.set_width(facts_.camera_config.width);
  camera.set_height(facts_.camera_config.height);
  camera.set_pixel_format(std::string(PixelFormatName(facts_.camera_config.format)));
  camera.set_gain_db(facts_.camera_config.gain_db);
  camera.set_min_exposure_us(Seconds(facts_.camera.min_exposure) * 1e6);
  camera.set_max_exposure_us(
      Seconds(std::min(facts_.camera.max_exposure, file.limits.max_exposure)) * 1e6);
  for (Duration exposure : facts_.default_exposures)
    camera.add_default_exposures_us(Seconds(exposure) * 1e6);
  const CameraGeometry& view = file.geometry.camera;
  *camera.mutable_position_m() = ToMessage(view.position);
  *camera.mutable_look_at_m() = ToMessage(view.look_at);
  camera.set_field_of_view_deg(view.field_of_view.degrees());

  if (rig_.lamps()) {
    *rig.add_devices() = ToMessage(rig_.lamps()->info().identity, v1::DEVICE_KIND_LAMPS);
    const BraceGeometry& brace = file.geometry.brace;
    v1::LampsDescription& lamps = *rig.mutable_lamps();
    for (const LampGeometry& lamp : brace.lamps)
      *lamps.add_directions() = ToMessage(DirectionFromAngles(lamp.azimuth, lamp.tilt));
    lamps.set_radius_m(brace.radius.meters());
    lamps.set_lamp_radius_m(brace.lamp_radius.meters());
    lamps.set_max_on(file.limits.max_lamps_on);
  }
  if (rig_.projector()) {
    *rig.add_devices() = ToMessage(rig_.projector()->info().identity, v1::DEVICE_KIND_PROJECTOR);
    const ProjectorGeometry& geometry = file.geometry.projector;
    v1::ProjectorDescription& projector = *rig.mutable_projector();
    projector.set_width(geometry.width);
    projector.set_height(geometry.height);
    projector.set_distance_m(geometry.distance.meters());
    projector.set_azimuth_deg(geometry.azimuth.degrees());
    projector.set_field_of_view_deg(geometry.field_of_view.degrees());
  }
  return grpc::Status::OK;
}

v1::RigState RigService::State() {
  // On virtual time an axis is never seen in motion: asking it would move time.
  RigSnapshot snapshot = rig_.Snapshot(!rig_.clock().is_virtual());
  v1::RigState state;
  RigUse use = rig_.use();
  state.set_activity(!snapshot.stop_reason.ok() ? v1::RIG_ACTIVITY_STOPPED
                     : use == RigUse::kRun      ? v1::RIG_ACTIVITY_RUN
                     : use == RigUse::kManual   ? v1::RIG_ACTIVITY_MANUAL
                                                : v1::RIG_ACTIVITY_IDLE);
  if (!snapshot.stop_reason.ok()) *state.mutable_stop_reason() = ToReason(snapshot.stop_reason);
  if (std::string run = runs_.active(); !run.empty()) state.set_active_run(RunName(run));
  for (const auto& [id, axis] : snapshot.axes) *state.add_axes() = ToMessage(id, axis);
  AddLit(snapshot.lamp_levels, state.mutable_lamps());
  if (rig_.projector()) {
    state.set_pattern_unknown(!snapshot.pattern.has_value());
    if (snapshot.pattern) *state.mutable_pattern() = rpc::ToMessage(*snapshot.pattern);
  }
  if (auto holder = control_.holder()) {
    state.mutable_control()->set_owner(holder->owner);
    state.mutable_control()->set_note(holder->note);
    *state.mutable_control()->mutable_expire_time() = rpc::ToMessage(holder->expires);
  }
  return state;
}

grpc::Status RigService::GetRigState(grpc::ServerContext*, const v1::GetRigStateRequest*,
                                     v1::GetRigStateResponse* response) {
  *response->mutable_state() = State();
  return grpc::Status::OK;
}

grpc::Status RigService::WatchRigState(grpc::ServerContext* context,
                                       const v1::WatchRigStateRequest* request,
                                       grpc::ServerWriter<v1::WatchRigStateResponse>* writer) {
  auto interval = WatchInterval(request->min_interval_seconds());
  if (!interval.ok()) return ToGrpc(interval.status());
  std::string last;
  while (!context->IsCancelled() && !closed_) {
    v1::WatchRigStateResponse response;
    *response.mutable_state() = State();
    // The lease's end moves with every renewal: by itself that is no change.
    v1::RigState compared = response.state();
    compared.mutable_control()->clear_expire_time();
    std::string now = compared.SerializeAsString();
    if (now != last && !writer->Write(response)) break;
    last = std::move(now);
    SleepUnless(*interval, [&] { return context->IsCancelled() || closed_; });
  }
  return grpc::Status::OK;
}

// ---- Control

grpc::Status RigService::AcquireControl(grpc::ServerContext*,
                                        const v1::AcquireControlRequest* request,
                                        v1::AcquireControlResponse* response) {
  auto token = control_.Acquire(request->owner(), request->note());
  if (!token.ok()) return ToGrpc(token.status());
  response->set_control_token(*token);
  response->set_heartbeat_seconds(Seconds(control_.heartbeat()));
  return grpc::Status::OK;
}

grpc::Status RigService::RenewControl(grpc::ServerContext*, const v1::RenewControlRequest* request,
                                      v1::RenewControlResponse* response) {
  auto expires = control_.Renew(request->control_token());
  if (!expires.ok()) return ToGrpc(expires.status());
  *response->mutable_expire_time() = rpc::ToMessage(*expires);
  return grpc::Status::OK;
}

grpc::Status RigService::ReleaseControl(grpc::ServerContext*,
                                        const v1::ReleaseControlRequest* request,
                                        v1::ReleaseControlResponse*) {
  return ToGrpc(control_.Release(request->control_token()));
}

// ---- By hand

absl::Status RigService::Manually(const std::string& token,
                                  absl::FunctionRef<absl::Status()> operation) {
  RETURN_IF_ERROR(control_.Check(token));
  RETURN_IF_ERROR(rig_.Acquire(RigUse::kManual));
  absl::Status status = operation();
  // Control may have been lost while the light was being switched on.
  if (!control_.Check(token).ok()) {
    absl::Status halted = rig_.Halt();
    if (status.ok()) status = halted.ok() ? control_.Check(token) : halted;
  }
  rig_.Release();
  return status;
}

grpc::Status RigService::MoveAxis(grpc::ServerContext* context, const v1::MoveAxisRequest* request,
                                  v1::MoveAxisResponse* response) {
  return ToGrpc(Manually(request->control_token(), [&]() -> absl::Status {
    ASSIGN_OR_RETURN(const AxisId id, FromMessage(request->axis()));
    double velocity = request->velocity_dps();
    if (velocity != 0 && !(velocity >= kLeastVelocity && std::isfinite(velocity))) {
      return Error(absl::StatusCode::kInvalidArgument, "VELOCITY",
                   absl::StrFormat("velocity_dps is %.10g; it must be 0, for the axis' own, or at "
                                   "least %g",
                                   velocity, kLeastVelocity),
                   {{"velocity_dps", absl::StrCat(velocity)}});
    }
    Angle target = Degrees(request->target_deg());
    RETURN_IF_ERROR(CheckPose(id == AxisId::kTurntable ? Pose{target, facts_.limits.tilt_min}
                                                       : Pose{facts_.limits.azimuth_min, target},
                              facts_));
    auto state = rig_.MoveAxis(id, target, velocity, [&] {
      return context->IsCancelled() || closed_ || !control_.Check(request->control_token()).ok();
    });
    if (!state.ok()) return state.status();
    *response->mutable_axis() = ToMessage(id, *state);
    return absl::OkStatus();
  }));
}

grpc::Status RigService::JogAxis(grpc::ServerContext* context, const v1::JogAxisRequest* request,
                                 v1::JogAxisResponse* response) {
  return ToGrpc(Manually(request->control_token(), [&]() -> absl::Status {
    ASSIGN_OR_RETURN(const AxisId id, FromMessage(request->axis()));
    const double velocity = request->velocity_dps(), seconds = request->seconds();
    if (!(std::abs(velocity) >= kLeastVelocity && std::isfinite(velocity))) {
      return Error(absl::StatusCode::kInvalidArgument, "VELOCITY",
                   absl::StrFormat("velocity_dps is %.10g; it must be at least %g or at most %g",
                                   velocity, kLeastVelocity, -kLeastVelocity),
                   {{"velocity_dps", absl::StrCat(velocity)}});
    }
    if (!(seconds > 0 && seconds <= kLongestJog)) {
      return Error(absl::StatusCode::kInvalidArgument, "JOG_TIME",
                   absl::StrFormat("seconds is %.10g; it must be above 0 and at most %g", seconds,
                                   kLongestJog),
                   {{"seconds", absl::StrCat(seconds)}});
    }
    auto state = rig_.JogAxis(id, velocity, FromSeconds(seconds), [&] {
      return context->IsCancelled() || closed_ || !control_.Check(request->control_token()).ok();
    });
    if (!state.ok()) return state.status();
    *response->mutable_axis() = ToMessage(id, *state);
    return absl::OkStatus();
  }));
}

absl::StatusOr<Condition> RigService::Light(bool with_lamps) {
  RigSnapshot snapshot = rig_.Snapshot(false);
  Condition light;
  if (!with_lamps) snapshot.lamp_levels.clear();
  for (size_t i = 0; i < snapshot.lamp_levels.size(); ++i) {
    if (std::isnan(snapshot.lamp_levels[i])) return LightUnknown(absl::StrCat("lamp ", i));
    if (snapshot.lamp_levels[i] > 0)
      light.lamps.push_back({static_cast<int>(i), snapshot.lamp_levels[i]});
  }
  if (!snapshot.pattern) return LightUnknown("the projector");
  if (snapshot.pattern->arrangement != PatternArrangement::kBlack) light.pattern = snapshot.pattern;
  return light;
}

absl::Status RigService::ApplyLight(const Condition& condition) {
  RETURN_IF_ERROR(CheckCondition(condition, facts_));
  absl::Status lit = rig_.StartCondition(condition)->Wait();
  // What did not confirm may be on: nobody should have to guess.
  if (!lit.ok()) RETURN_IF_ERROR(Annotate(rig_.Dark(), MessageOf(lit)));
  return lit;
}

grpc::Status RigService::SetLamps(grpc::ServerContext*, const v1::SetLampsRequest* request,
                                  v1::SetLampsResponse* response) {
  return ToGrpc(Manually(request->control_token(), [&]() -> absl::Status {
    ASSIGN_OR_RETURN(Condition light, Light(/*with_lamps=*/!request->others_off()));
    for (const v1::LampLevel& asked : request->lamps()) {
      std::erase_if(light.lamps, [&](const LampLevel& l) { return l.lamp == asked.lamp(); });
      light.lamps.push_back({asked.lamp(), asked.level()});
    }
    RETURN_IF_ERROR(CheckCondition(light, facts_));
    std::erase_if(light.lamps, [](const LampLevel& l) { return l.level == 0; });
    RETURN_IF_ERROR(ApplyLight(light));
    AddLit(rig_.Snapshot(false).lamp_levels, response->mutable_lamps());
    return absl::OkStatus();
  }));
}

grpc::Status RigService::ShowPattern(grpc::ServerContext*, const v1::ShowPatternRequest* request,
                                     v1::ShowPatternResponse* response) {
  return ToGrpc(Manually(request->control_token(), [&]() -> absl::Status {
    ASSIGN_OR_RETURN(Condition light, Light());
    ASSIGN_OR_RETURN(light.pattern, FromMessage(request->pattern()));
    RETURN_IF_ERROR(ApplyLight(light));
    const std::optional<Pattern> shown = rig_.Snapshot(false).pattern;
    if (!shown) return LightUnknown("the projector");  // somebody darkened it meanwhile
    *response->mutable_pattern() = rpc::ToMessage(*shown);
    return absl::OkStatus();
  }));
}

grpc::Status RigService::Snap(grpc::ServerContext*, const v1::SnapRequest* request,
                              grpc::ServerWriter<v1::SnapResponse>* writer) {
  std::string file;
  v1::SnapResponse about;
  absl::Status taken = Manually(request->control_token(), [&]() -> absl::Status {
    RawShot raw;
    ASSIGN_OR_RETURN(raw.shot.exposures, ExposuresFromMessage(request->exposures_us()));
    if (raw.shot.exposures.empty()) raw.shot.exposures = facts_.default_exposures;
    RETURN_IF_ERROR(CheckExposures(raw.shot.exposures, facts_));
    uint64_t since = rig_.disturbances();
    ASSIGN_OR_RETURN(raw.shot.condition, Light());
    ASSIGN_OR_RETURN(raw.reported_pose, rig_.ReadPose());
    raw.shot.pose = raw.reported_pose;
    RETURN_IF_ERROR(rig_.ArmCamera());
    raw.captured_at = rig_.WallNow();
    Bracket bracket(rig_, raw.shot.exposures, since);
    absl::Status exposed = bracket.Expose();
    auto frames = exposed.ok() ? bracket.TakeFrames() : exposed;
    absl::Status disarmed = rig_.DisarmCamera();
    if (!frames.ok()) return frames.status();
    RETURN_IF_ERROR(disarmed);
    raw.frames = *std::move(frames);
    raw.exposures = ExposureRecords(raw.shot.exposures, raw.frames);
    ASSIGN_OR_RETURN(Developed developed, Develop(raw, rig_.file().develop, rig_.file().geometry));
    about.set_saturated_share(developed.checks.saturated_share);
    about.set_black_share(developed.checks.black_share);
    AddExposures(raw.exposures, about.mutable_exposures());
    ASSIGN_OR_RETURN(ExrCompression compression, ParseExrCompression(facts_.compression));
    FrameAttributes attributes{.rig_name = rig_.file().name,
                               .shot = raw.shot,
                               .reported_pose = raw.reported_pose,
                               .direction = developed.direction,
                               .captured_at = FormatUtc(raw.captured_at),
                               .camera = facts_.geometry.camera};
    for (const ExposureRecord& exposure : raw.exposures)
      attributes.exposures_s.push_back(Seconds(exposure.used));
    ASSIGN_OR_RETURN(file, EncodeBasisExr(developed.image, attributes, compression));
    return absl::OkStatus();
  });
  if (!taken.ok()) return ToGrpc(taken);
  WriteChunks<v1::SnapResponse>(*writer, file,
                                [&](v1::SnapResponse& first) { first.MergeFrom(about); });
  return grpc::Status::OK;
}

grpc::Status RigService::StopRig(grpc::ServerContext*, const v1::StopRigRequest* request,
                                 v1::StopRigResponse* response) {
  // Cut rather than refused: stop must not fail for its note.
  std::string note = CutUtf8(request->note(), 500);
  absl::Status reason =
      Error(absl::StatusCode::kAborted, "STOP_ASKED",
            note.empty() ? "stop was asked for" : absl::StrCat("stop: ", note), {{"note", note}});
  absl::Status stopped = rig_.Stop(reason);
  // After the rig: the run's journal may wait for a disk. It may have noticed by itself.
  runs_.HoldActive(reason);
  if (!stopped.ok()) return ToGrpc(stopped);
  *response->mutable_state() = State();
  return grpc::Status::OK;
}

grpc::Status RigService::ResetRig(grpc::ServerContext*, const v1::ResetRigRequest* request,
                                  v1::ResetRigResponse* response) {
  absl::Status reset = control_.Check(request->control_token());
  if (reset.ok() && !runs_.at_rest()) {
    reset = Error(absl::StatusCode::kFailedPrecondition, "RUN_ACTIVE",
                  "a run is using the rig; reset when it is paused or has ended");
  }
  if (reset.ok()) reset = rig_.Reset();
  if (!reset.ok()) return ToGrpc(reset);
  *response->mutable_state() = State();
  return grpc::Status::OK;
}

}  // namespace lightstage::rpc
