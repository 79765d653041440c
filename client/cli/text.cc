#include "client/cli/text.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/ascii.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/strip.h"
#include "absl/time/time.h"
#include "base/strings.h"

namespace lightstage::client {

std::string BytesText(int64_t bytes) {
  static constexpr const char* kUnits[] = {"B", "KiB", "MiB", "GiB", "TiB", "PiB"};
  double value = static_cast<double>(bytes);
  size_t unit = 0;
  // What would round to 1024.0 is shown as 1.0 of the next unit.
  while (std::abs(value) >= 1023.95 && unit + 1 < std::size(kUnits)) {
    value /= 1024;
    ++unit;
  }
  return unit == 0 ? absl::StrCat(bytes, " B") : absl::StrFormat("%.1f %s", value, kUnits[unit]);
}

std::string DurationText(double seconds) {
  if (!std::isfinite(seconds) || seconds < 0 || seconds > 1e15) return "?";
  auto s = static_cast<int64_t>(std::llround(seconds));
  return absl::StrFormat("%d:%02d:%02d", s / 3600, s / 60 % 60, s % 60);
}

std::string NumberText(double value, int digits) {
  std::string text = absl::StrFormat("%.*f", digits, value);
  if (text.find('.') != std::string::npos) {
    text.erase(text.find_last_not_of('0') + 1);
    if (text.back() == '.') text.pop_back();
  }
  return text == "-0" ? "0" : text;
}

std::string TimeText(const google::protobuf::Timestamp& time) {
  return absl::FormatTime("%Y-%m-%d %H:%M:%S", absl::FromUnixSeconds(time.seconds()),
                          absl::LocalTimeZone());
}

std::string Table(const std::vector<std::vector<std::string>>& rows) {
  std::vector<size_t> widths;
  for (const auto& row : rows) {
    widths.resize(std::max(widths.size(), row.size()));
    for (size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], row[i].size());
  }
  std::string text;
  for (const auto& row : rows) {
    for (size_t i = 0; i < row.size(); ++i) {
      text += row[i];
      if (i + 1 < row.size()) text.append(widths[i] - row[i].size() + 2, ' ');
    }
    text.erase(text.find_last_not_of(' ') + 1);  // empty cells at the end
    text += '\n';
  }
  return text;
}

namespace {

// A list longer than this is told by its ends.
constexpr int kMostAngles = 4;

// "RIG_ACTIVITY_IDLE" → "idle".
std::string EnumText(const std::string& name, absl::string_view prefix) {
  return absl::AsciiStrToLower(absl::StripPrefix(name, prefix));
}

std::string Degrees(double value) { return absl::StrCat(NumberText(value), " deg"); }

std::string PoseText(const v1::Pose& pose) {
  return absl::StrCat("azimuth ", NumberText(pose.azimuth_deg()), " deg, tilt ",
                      NumberText(pose.tilt_deg()), " deg");
}

// "3 azimuths (0, 45, 90 deg)"
std::string AngleListText(const v1::AngleList& list, std::string_view what) {
  const auto& angles = list.angles_deg();
  std::string text =
      angles.size() > kMostAngles
          ? absl::StrCat(NumberText(angles.Get(0)), " ... ",
                         NumberText(angles.Get(angles.size() - 1)))
          : absl::StrJoin(angles, ", ", [](std::string* out, double a) { *out += NumberText(a); });
  return absl::StrCat(angles.size(), " ", what, " (", text, " deg)");
}

std::string AxisName(v1::AxisId axis) { return EnumText(v1::AxisId_Name(axis), "AXIS_ID_"); }

std::string VectorText(const v1::Vector& v) {
  return absl::StrCat("(", NumberText(v.x()), ", ", NumberText(v.y()), ", ", NumberText(v.z()),
                      ")");
}

std::string ExposuresText(const google::protobuf::RepeatedField<double>& exposures) {
  return absl::StrCat(
      absl::StrJoin(exposures, ", ", [](std::string* out, double e) { *out += NumberText(e); }),
      " us");
}

}  // namespace

std::string StateText(v1::RunState state) {
  return EnumText(v1::RunState_Name(state), "RUN_STATE_");
}

std::string LampsText(const google::protobuf::RepeatedPtrField<v1::LampLevel>& lamps) {
  if (lamps.empty()) return "dark";
  return absl::StrJoin(lamps, " ", [](std::string* out, const v1::LampLevel& lamp) {
    absl::StrAppend(out, lamp.lamp(), "=", NumberText(lamp.level()));
  });
}

std::string PatternText(const v1::Pattern& p) {
  std::string text = EnumText(v1::PatternArrangement_Name(p.arrangement()), "PATTERN_ARRANGEMENT_");
  switch (p.arrangement()) {
    case v1::PATTERN_ARRANGEMENT_SQUARE:
    case v1::PATTERN_ARRANGEMENT_HORIZONTAL:
    case v1::PATTERN_ARRANGEMENT_VERTICAL:
      absl::StrAppend(&text, " column ", p.column(), " row ", p.row(), " of grid ", p.grid());
      break;
    default:
      return text;
  }
  if (p.arrangement() != v1::PATTERN_ARRANGEMENT_SQUARE) {
    absl::StrAppend(&text, ", influence ", p.influence());
  }
  return absl::StrCat(text, ", ",
                      EnumText(v1::PatternProfile_Name(p.profile()), "PATTERN_PROFILE_"));
}

std::string PlanText(const v1::Plan& plan) {
  std::string text;
  if (plan.has_light_stage()) {
    const v1::LightStage& stage = plan.light_stage();
    text = "light stage: ";
    if (stage.has_azimuth_list()) {
      text += AngleListText(stage.azimuth_list(), "azimuths");
    } else {
      absl::StrAppend(&text, stage.azimuths(), " azimuths over ",
                      NumberText(stage.has_span_deg() ? stage.span_deg() : 180), " deg");
    }
    absl::StrAppend(
        &text, ", ",
        stage.lamps().empty() ? "all lamps" : absl::StrCat(stage.lamps_size(), " lamps"));
    if (stage.has_tilt_deg()) {
      absl::StrAppend(&text, ", projector at tilt ", Degrees(stage.tilt_deg()));
    }
    if (stage.has_level() && stage.level() != 1)
      absl::StrAppend(&text, " at level ", NumberText(stage.level()));
  } else if (plan.has_projector_4d()) {
    const v1::Projector4d& projector = plan.projector_4d();
    text = "projector 4D: ";
    if (projector.has_tilt_list()) {
      absl::StrAppend(&text, AngleListText(projector.tilt_list(), "tilts"), " x ");
    } else {
      absl::StrAppend(&text, projector.tilts(), " tilts x ");
    }
    if (projector.has_azimuth_list()) {
      text += AngleListText(projector.azimuth_list(), "azimuths");
    } else {
      absl::StrAppend(&text, projector.azimuths(), " azimuths");
    }
    absl::StrAppend(
        &text, ", grid ", projector.grid(), ", ",
        projector.profile() == v1::PATTERN_PROFILE_UNSPECIFIED
            ? "box"
            : EnumText(v1::PatternProfile_Name(projector.profile()), "PATTERN_PROFILE_"),
        projector.has_influence() ? absl::StrCat(", influence ", projector.influence()) : ", full");
  } else {
    text = "no program that this client knows";
  }
  if (!plan.exposures_us().empty()) {
    absl::StrAppend(&text, ", exposures ", ExposuresText(plan.exposures_us()));
  }
  if (plan.dark_every() != 0) absl::StrAppend(&text, ", dark frame every ", plan.dark_every());
  if (plan.reference_every() != 0) {
    absl::StrAppend(&text, ", reference frame every ", plan.reference_every());
  }
  return text;
}

std::string ReasonText(const v1::Reason& reason) {
  return absl::StrCat(reason.reason(), ": ", reason.message());
}

std::string EstimateText(const v1::Plan& plan, const v1::EstimateRunResponse& e) {
  const std::string bytes =
      absl::StrCat(BytesText(e.bytes()), " (", BytesText(e.free_bytes()), " free)");
  std::string text = absl::StrCat(PlanText(plan), "\n",
                                  Table({{"shots", absl::StrCat(e.shots())},
                                         {"extraShots", absl::StrCat(e.extra_shots())},
                                         {"exposures", absl::StrCat(e.exposures())},
                                         {"positions", absl::StrCat(e.positions())},
                                         {"durationSeconds", DurationText(e.duration_seconds())},
                                         {"bytes", bytes}}));
  for (const std::string& note : e.notes()) absl::StrAppend(&text, "note: ", note, "\n");
  return text;
}

std::string RunText(const v1::Run& run) {
  std::vector<std::vector<std::string>> rows = {{"run", run.name()}};
  if (!run.display_name().empty() && absl::StrCat("runs/", run.display_name()) != run.name()) {
    rows.push_back({"name", run.display_name()});
  }
  rows.push_back({"state", StateText(run.state())});
  if (run.has_reason()) rows.push_back({"reason", ReasonText(run.reason())});
  rows.push_back({"plan", PlanText(run.plan())});
  rows.push_back({"shots", absl::StrCat(run.done_shots(), " of ", run.total_shots(), ", ",
                                        run.retakes(), " retakes, ", run.dark_basis_shots(),
                                        " basis images on which nothing was seen")});
  rows.push_back({"stored", BytesText(run.stored_bytes())});
  if (run.shots_per_second() > 0) {
    rows.push_back({"rate", absl::StrCat(NumberText(run.shots_per_second(), 2), " shots/s, ",
                                         DurationText(run.remaining_seconds()), " left")});
  }
  if (!run.has_end_time()) rows.push_back({"pose", PoseText(run.pose())});
  rows.push_back({"started", TimeText(run.create_time())});
  if (run.has_end_time()) rows.push_back({"ended", TimeText(run.end_time())});
  rows.push_back({"directory", run.directory()});
  return Table(rows);
}

std::string RunsText(const v1::ListRunsResponse& runs) {
  if (runs.runs().empty()) return "no runs\n";
  std::vector<std::vector<std::string>> rows = {{"RUN", "STATE", "SHOTS", "STARTED", "NAME"}};
  for (const v1::Run& run : runs.runs()) {
    rows.push_back({run.name(), StateText(run.state()),
                    absl::StrCat(run.done_shots(), "/", run.total_shots()),
                    TimeText(run.create_time()), run.display_name()});
  }
  return Table(rows);
}

std::string RigText(const v1::Rig& rig) {
  std::string text = Table({{"rig", rig.display_name()},
                            {"daemon", rig.daemon_version()},
                            {"time", rig.virtual_time() ? "virtual" : "real"},
                            {"heartbeat", NumberText(rig.heartbeat_seconds()) + " s"}});
  std::vector<std::vector<std::string>> devices = {{"DEVICE", "KIND", "DRIVER", "MODEL", "SERIAL"}};
  for (const v1::Device& d : rig.devices()) {
    devices.push_back({d.name(), EnumText(v1::DeviceKind_Name(d.kind()), "DEVICE_KIND_"),
                       d.driver(), d.model(), d.serial()});
  }
  absl::StrAppend(&text, "\n", Table(devices), "\n");
  std::vector<std::vector<std::string>> rows;
  for (const v1::AxisDescription& axis : rig.axes()) {
    rows.push_back({AxisName(axis.axis()),
                    absl::StrCat(axis.continuous() ? "turns without end"
                                                   : absl::StrCat(NumberText(axis.min_deg()),
                                                                  " to ", Degrees(axis.max_deg())),
                                 ", at most ", NumberText(axis.max_velocity_dps()), " deg/s and ",
                                 NumberText(axis.max_acceleration_dps2()), " deg/s2")});
  }
  const v1::CameraDescription& camera = rig.camera();
  rows.push_back(
      {"camera", absl::StrCat(camera.width(), " x ", camera.height(), " ", camera.pixel_format(),
                              ", gain ", NumberText(camera.gain_db()), " dB, exposure ",
                              NumberText(camera.min_exposure_us()), " to ",
                              NumberText(camera.max_exposure_us()), " us")});
  rows.push_back({"", absl::StrCat("bracket ", ExposuresText(camera.default_exposures_us()))});
  rows.push_back({"", absl::StrCat("at ", VectorText(camera.position_m()), " m, looks at ",
                                   VectorText(camera.look_at_m()), " m, ",
                                   Degrees(camera.field_of_view_deg()), " wide")});
  if (rig.has_lamps()) {
    rows.push_back({"lamps", absl::StrCat(rig.lamps().directions_size(), " at ",
                                          NumberText(rig.lamps().radius_m()), " m, radius ",
                                          NumberText(rig.lamps().lamp_radius_m()), " m, at most ",
                                          rig.lamps().max_on(), " on at once")});
  }
  if (rig.has_projector()) {
    const v1::ProjectorDescription& p = rig.projector();
    rows.push_back(
        {"projector", absl::StrCat(p.width(), " x ", p.height(), " at ", NumberText(p.distance_m()),
                                   " m, azimuth ", Degrees(p.azimuth_deg()), ", ",
                                   Degrees(p.field_of_view_deg()), " wide")});
  }
  return text + Table(rows);
}

std::string RigStateText(const v1::RigState& state) {
  std::vector<std::vector<std::string>> rows = {
      {"activity", EnumText(v1::RigActivity_Name(state.activity()), "RIG_ACTIVITY_")}};
  if (state.has_stop_reason()) rows.push_back({"stopped", ReasonText(state.stop_reason())});
  if (!state.active_run().empty()) rows.push_back({"run", state.active_run()});
  for (const v1::AxisState& axis : state.axes()) {
    rows.push_back(
        {AxisName(axis.axis()),
         absl::StrCat(axis.homed() ? Degrees(axis.position_deg()) : "not homed",
                      axis.moving()
                          ? absl::StrCat(", moving at ", NumberText(axis.velocity_dps()), " deg/s")
                          : "")});
  }
  rows.push_back({"lamps", LampsText(state.lamps())});
  if (state.pattern_unknown()) rows.push_back({"projector", "unknown"});
  if (state.has_pattern()) rows.push_back({"projector", PatternText(state.pattern())});
  rows.push_back(
      {"control", state.has_control()
                      ? absl::StrCat(state.control().owner(),
                                     state.control().note().empty()
                                         ? ""
                                         : absl::StrCat(" (", state.control().note(), ")"))
                      : "nobody"});
  return Table(rows);
}

std::string ShotText(const v1::Shot& shot) {
  return absl::StrCat("shot ", shot.id(), ": ",
                      EnumText(v1::ShotKind_Name(shot.kind()), "SHOT_KIND_"), ", ",
                      PoseText(shot.pose()), ", ", shot.file(), shot.attempts() > 1 ? ", " : "",
                      shot.attempts() > 1 ? absl::StrCat(shot.attempts(), " attempts") : "",
                      shot.nothing_seen() ? ", nothing seen" : "");
}

std::string AdjustedText(const google::protobuf::RepeatedPtrField<v1::Exposure>& exposures) {
  constexpr double kClockTick = 1e-3;  // what a Duration holds, microseconds
  std::string text;
  for (const v1::Exposure& exposure : exposures) {
    if (std::abs(exposure.used_us() - exposure.requested_us()) <= kClockTick) continue;
    absl::StrAppend(&text, "exposure ", NumberText(exposure.requested_us()),
                    " us: the camera used ", NumberText(exposure.used_us()), " us\n");
  }
  return text;
}

}  // namespace lightstage::client
