#include "daemon/rpc/convert.h"

#include <cmath>

#include "absl/strings/str_format.h"
#include "base/status.h"
#include "google/protobuf/util/json_util.h"
#include "google/protobuf/util/time_util.h"

namespace lightstage::rpc {
namespace {

absl::Status Invalid(std::string_view field, double value, std::string_view right) {
  return Error(absl::StatusCode::kInvalidArgument, "PLAN_FIELD",
               absl::StrFormat("%s is %.10g; %s", std::string(field), value, std::string(right)),
               {{"field", std::string(field)}, {"value", absl::StrCat(value)}});
}

absl::Status Missing(std::string_view field, std::string_view right) {
  return Error(absl::StatusCode::kInvalidArgument, "PLAN_FIELD",
               absl::StrFormat("%s is not set; %s", std::string(field), std::string(right)),
               {{"field", std::string(field)}});
}

std::vector<Angle> Angles(const v1::AngleList& list) {
  std::vector<Angle> angles;
  for (double degrees : list.angles_deg()) angles.push_back(Degrees(degrees));
  return angles;
}

void ToMessage(const std::vector<Angle>& angles, v1::AngleList* list) {
  for (Angle angle : angles) list->add_angles_deg(angle.degrees());
}

absl::Status CheckCount(std::string_view field, int32_t count) {
  if (count >= 1 && count <= 100000) return absl::OkStatus();
  return Invalid(field, count, "1 to 100000 positions are possible");
}

absl::StatusOr<PatternProfile> ProfileFromMessage(v1::PatternProfile profile) {
  switch (profile) {
    case v1::PATTERN_PROFILE_UNSPECIFIED:
    case v1::PATTERN_PROFILE_BOX:
      return PatternProfile::kBox;
    case v1::PATTERN_PROFILE_GAUSSIAN:
      return PatternProfile::kGaussian;
    case v1::PATTERN_PROFILE_HAT:
      return PatternProfile::kHat;
    default:
      return Invalid("profile", profile, "BOX, GAUSSIAN and HAT are known");
  }
}

v1::PatternProfile ToMessage(PatternProfile profile) {
  switch (profile) {
    case PatternProfile::kBox:
      return v1::PATTERN_PROFILE_BOX;
    case PatternProfile::kGaussian:
      return v1::PATTERN_PROFILE_GAUSSIAN;
    case PatternProfile::kHat:
      return v1::PATTERN_PROFILE_HAT;
  }
  return v1::PATTERN_PROFILE_UNSPECIFIED;
}

absl::StatusOr<LightStagePlan> FromMessage(const v1::LightStage& message, int lamp_count) {
  LightStagePlan plan;
  if (message.has_azimuth_list()) {
    plan.azimuths = Angles(message.azimuth_list());
  } else if (message.has_azimuths()) {
    double span = message.has_span_deg() ? message.span_deg() : 180;
    if (!(span > 0 && span <= 360)) return Invalid("span_deg", span, "it must be in (0, 360]");
    RETURN_IF_ERROR(CheckCount("azimuths", message.azimuths()));
    plan.azimuths = EvenAzimuths(message.azimuths(), Degrees(span));
  } else {
    return Missing("azimuths", "set azimuths (a count) or azimuth_list");
  }
  plan.lamps.assign(message.lamps().begin(), message.lamps().end());
  if (plan.lamps.empty()) plan.lamps = AllLamps(lamp_count);
  plan.level = message.has_level() ? message.level() : 1;
  if (message.has_tilt_deg()) plan.tilt = Degrees(message.tilt_deg());
  return plan;
}

absl::StatusOr<Projector4dPlan> FromMessage(const v1::Projector4d& message) {
  Projector4dPlan plan;
  if (message.has_azimuth_list()) {
    plan.azimuths = Angles(message.azimuth_list());
  } else if (message.has_azimuths()) {
    RETURN_IF_ERROR(CheckCount("azimuths", message.azimuths()));
    plan.azimuths = EvenAzimuths(message.azimuths(), Degrees(360));
  } else {
    return Missing("azimuths", "set azimuths (a count) or azimuth_list");
  }
  if (message.has_tilt_list()) {
    plan.tilts = Angles(message.tilt_list());
  } else if (message.has_tilts()) {
    RETURN_IF_ERROR(CheckCount("tilts", message.tilts()));
    plan.tilts = CellCentredTilts(message.tilts());
  } else {
    return Missing("tilts", "set tilts (a count) or tilt_list");
  }
  plan.grid = message.grid();
  ASSIGN_OR_RETURN(plan.profile, ProfileFromMessage(message.profile()));
  if (message.has_influence()) {
    plan.influence = message.influence();
  } else if (!message.has_full() || !message.full()) {
    return Missing("full", "set full to true, or influence to the distance d");
  }
  switch (message.order()) {
    case v1::AXIS_ORDER_UNSPECIFIED:
      plan.order = AxisOrder::kFastest;
      break;
    case v1::AXIS_ORDER_TILT_OUTSIDE:
      plan.order = AxisOrder::kTiltOutside;
      break;
    case v1::AXIS_ORDER_AZIMUTH_OUTSIDE:
      plan.order = AxisOrder::kAzimuthOutside;
      break;
    default:
      return Invalid("order", message.order(), "TILT_OUTSIDE and AZIMUTH_OUTSIDE are known");
  }
  return plan;
}

v1::ShotKind ToMessage(ShotKind kind) {
  switch (kind) {
    case ShotKind::kBasis:
      return v1::SHOT_KIND_BASIS;
    case ShotKind::kDark:
      return v1::SHOT_KIND_DARK;
    case ShotKind::kReference:
      return v1::SHOT_KIND_REFERENCE;
  }
  return v1::SHOT_KIND_UNSPECIFIED;
}

double Microseconds(Duration d) { return d.count() / 1000.0; }

}  // namespace

absl::StatusOr<std::vector<Duration>> ExposuresFromMessage(
    const google::protobuf::RepeatedField<double>& exposures_us) {
  std::vector<Duration> exposures;
  for (double us : exposures_us) {
    // A day bounds the conversion; what the camera can do is checked against the rig.
    if (!(us > 0 && us < 86400e6))
      return Invalid("exposures_us", us, "an exposure is above 0 and below a day, in microseconds");
    exposures.push_back(Duration(std::llround(us * 1000)));
  }
  return exposures;
}

absl::StatusOr<Plan> FromMessage(const v1::Plan& message, int lamp_count) {
  Plan plan;
  ASSIGN_OR_RETURN(plan.common.exposures, ExposuresFromMessage(message.exposures_us()));
  plan.common.dark_every = message.dark_every();
  plan.common.reference_every = message.reference_every();
  if (message.has_light_stage()) {
    ASSIGN_OR_RETURN(plan.kind, FromMessage(message.light_stage(), lamp_count));
  } else if (message.has_projector_4d()) {
    ASSIGN_OR_RETURN(plan.kind, FromMessage(message.projector_4d()));
  } else {
    return Missing("program", "set light_stage or projector_4d");
  }
  return plan;
}

v1::Plan ToMessage(const Plan& plan) {
  v1::Plan message;
  for (Duration exposure : plan.common.exposures) message.add_exposures_us(Microseconds(exposure));
  message.set_dark_every(plan.common.dark_every);
  message.set_reference_every(plan.common.reference_every);
  if (const auto* stage = std::get_if<LightStagePlan>(&plan.kind)) {
    v1::LightStage* m = message.mutable_light_stage();
    ToMessage(stage->azimuths, m->mutable_azimuth_list());
    m->mutable_lamps()->Assign(stage->lamps.begin(), stage->lamps.end());
    m->set_level(stage->level);
    if (stage->tilt) m->set_tilt_deg(stage->tilt->degrees());
  } else {
    const auto& projector = std::get<Projector4dPlan>(plan.kind);
    v1::Projector4d* m = message.mutable_projector_4d();
    ToMessage(projector.azimuths, m->mutable_azimuth_list());
    ToMessage(projector.tilts, m->mutable_tilt_list());
    m->set_grid(projector.grid);
    m->set_profile(ToMessage(projector.profile));
    if (projector.influence)
      m->set_influence(*projector.influence);
    else
      m->set_full(true);
    m->set_order(projector.order == AxisOrder::kFastest       ? v1::AXIS_ORDER_UNSPECIFIED
                 : projector.order == AxisOrder::kTiltOutside ? v1::AXIS_ORDER_TILT_OUTSIDE
                                                              : v1::AXIS_ORDER_AZIMUTH_OUTSIDE);
  }
  return message;
}

absl::StatusOr<Pattern> FromMessage(const v1::Pattern& message) {
  Pattern pattern;
  switch (message.arrangement()) {
    case v1::PATTERN_ARRANGEMENT_BLACK:
      return pattern;
    case v1::PATTERN_ARRANGEMENT_FULL:
      pattern.arrangement = PatternArrangement::kFull;
      return pattern;
    case v1::PATTERN_ARRANGEMENT_SQUARE:
      pattern.arrangement = PatternArrangement::kSquare;
      break;
    case v1::PATTERN_ARRANGEMENT_HORIZONTAL:
      pattern.arrangement = PatternArrangement::kHorizontal;
      break;
    case v1::PATTERN_ARRANGEMENT_VERTICAL:
      pattern.arrangement = PatternArrangement::kVertical;
      break;
    default:
      return Invalid("arrangement", message.arrangement(),
                     "BLACK, FULL, SQUARE, HORIZONTAL and VERTICAL are known");
  }
  ASSIGN_OR_RETURN(pattern.profile, ProfileFromMessage(message.profile()));
  pattern.grid = message.grid();
  pattern.influence = message.influence();
  pattern.column = message.column();
  pattern.row = message.row();
  RETURN_IF_ERROR(Validate(pattern));
  return pattern;
}

v1::Pattern ToMessage(const Pattern& pattern) {
  v1::Pattern message;
  switch (pattern.arrangement) {
    case PatternArrangement::kBlack:
      message.set_arrangement(v1::PATTERN_ARRANGEMENT_BLACK);
      return message;
    case PatternArrangement::kFull:
      message.set_arrangement(v1::PATTERN_ARRANGEMENT_FULL);
      return message;
    case PatternArrangement::kSquare:
      message.set_arrangement(v1::PATTERN_ARRANGEMENT_SQUARE);
      break;
    case PatternArrangement::kHorizontal:
      message.set_arrangement(v1::PATTERN_ARRANGEMENT_HORIZONTAL);
      break;
    case PatternArrangement::kVertical:
      message.set_arrangement(v1::PATTERN_ARRANGEMENT_VERTICAL);
      break;
  }
  message.set_profile(ToMessage(pattern.profile));
  message.set_grid(pattern.grid);
  message.set_influence(pattern.influence);
  message.set_column(pattern.column);
  message.set_row(pattern.row);
  return message;
}

v1::Pose ToMessage(const Pose& pose) {
  v1::Pose message;
  message.set_azimuth_deg(pose.azimuth.degrees());
  message.set_tilt_deg(pose.tilt.degrees());
  return message;
}

v1::Vector ToMessage(const Vec3& v) {
  v1::Vector message;
  message.set_x(v.x());
  message.set_y(v.y());
  message.set_z(v.z());
  return message;
}

google::protobuf::Timestamp ToMessage(WallTime t) {
  return google::protobuf::util::TimeUtil::MicrosecondsToTimestamp(t.time_since_epoch().count());
}

void AddExposures(const std::vector<ExposureRecord>& exposures,
                  google::protobuf::RepeatedPtrField<v1::Exposure>* messages) {
  for (const ExposureRecord& exposure : exposures) {
    v1::Exposure* m = messages->Add();
    m->set_requested_us(Microseconds(exposure.requested));
    m->set_used_us(Microseconds(exposure.used));
    m->set_gain_db(exposure.gain_db);
    m->set_start_seconds(Seconds(exposure.start.time_since_epoch()));
    m->set_end_seconds(Seconds(exposure.end.time_since_epoch()));
    m->set_device_timestamp_ns(exposure.device_timestamp_ns);
    m->set_frame_sequence(exposure.frame_sequence);
  }
}

v1::Shot ToMessage(const ShotRecord& record) {
  v1::Shot message;
  message.set_id(static_cast<int64_t>(record.shot.id));
  message.set_kind(ToMessage(record.shot.kind));
  *message.mutable_pose() = ToMessage(record.shot.pose);
  *message.mutable_reported_pose() = ToMessage(record.reported_pose);
  v1::Condition* condition = message.mutable_condition();
  for (const LampLevel& level : record.shot.condition.lamps) {
    v1::LampLevel* m = condition->add_lamps();
    m->set_lamp(level.lamp);
    m->set_level(level.level);
  }
  if (record.shot.condition.pattern)
    *condition->mutable_pattern() = ToMessage(*record.shot.condition.pattern);
  if (record.direction) *message.mutable_direction() = ToMessage(*record.direction);
  AddExposures(record.exposures, message.mutable_exposures());
  message.set_attempts(record.attempts);
  message.set_lit_seconds(Seconds(record.lit_at.time_since_epoch()));
  google::protobuf::util::TimeUtil::FromString(record.captured_at, message.mutable_capture_time());
  message.set_file(record.file);
  message.set_bytes(static_cast<int64_t>(record.bytes));
  message.set_sha256(record.sha256);
  message.set_saturated_share(record.checks.saturated_share);
  message.set_black_share(record.checks.black_share);
  message.set_nothing_seen(record.checks.nothing_seen);
  return message;
}

absl::StatusOr<std::string> PlanToJson(const Plan& plan) {
  std::string json;
  auto status = google::protobuf::util::MessageToJsonString(ToMessage(plan), &json);
  if (!status.ok()) return absl::InternalError(status.ToString());
  return json;
}

absl::StatusOr<Plan> PlanFromJson(const std::string& json, int lamp_count) {
  v1::Plan message;
  auto status = google::protobuf::util::JsonStringToMessage(json, &message);
  if (!status.ok()) {
    return Error(absl::StatusCode::kDataLoss, "PLAN_UNREADABLE",
                 absl::StrCat("the stored plan cannot be read: ", status.ToString()));
  }
  return FromMessage(message, lamp_count);
}

}  // namespace lightstage::rpc
