// move, jog, lamps, pattern, snap

#include <memory>
#include <optional>
#include <utility>

#include "base/status.h"
#include "base/strings.h"
#include "client/cli/commands.h"
#include "client/cli/options.h"
#include "client/cli/text.h"
#include "client/cli/values.h"

namespace lightstage::client {
namespace {

// For an axis that was told to stop.
constexpr Duration kStopPatience = std::chrono::seconds(10);

constexpr char kHoldHelp[] = R"(
Light is on only while somebody has control: this command keeps control, and the
light, until Ctrl-C or for --hold seconds. Without a terminal and without --hold
the light goes off at once. To take a picture under the light, use snap --lamps
and snap --pattern.)";

struct MoveFlags {
  v1::AxisId axis = v1::AXIS_ID_UNSPECIFIED;
  double target_deg = 0;
  double velocity_dps = 0;
};

struct JogFlags {
  v1::AxisId axis = v1::AXIS_ID_UNSPECIFIED;
  double velocity_dps = 0;
  double seconds = 3600;  // the longest that the daemon allows
};

struct LightFlags {
  std::vector<v1::LampLevel> lamps;
  std::optional<v1::Pattern> pattern;
  std::optional<double> hold_seconds;
};

struct SnapFlags {
  LightFlags light;
  std::vector<double> exposures_us;
  std::string out;
};

absl::StatusOr<v1::SetLampsResponse> SetLamps(Session& session, const ControlLease& lease,
                                              const std::vector<v1::LampLevel>& lamps) {
  ASSIGN_OR_RETURN(Connection * connection, session.Connect());
  v1::SetLampsRequest request;
  request.set_control_token(lease.token());
  request.mutable_lamps()->Add(lamps.begin(), lamps.end());
  request.set_others_off(true);
  return Call(connection->rig(), &v1::RigService::Stub::SetLamps, request,
              session.world().interrupt);
}

absl::StatusOr<v1::ShowPatternResponse> ShowPattern(Session& session, const ControlLease& lease,
                                                    const v1::Pattern& pattern) {
  ASSIGN_OR_RETURN(Connection * connection, session.Connect());
  v1::ShowPatternRequest request;
  request.set_control_token(lease.token());
  *request.mutable_pattern() = pattern;
  return Call(connection->rig(), &v1::RigService::Stub::ShowPattern, request,
              session.world().interrupt);
}

// Keeps control as long as the user wants light. Ctrl-C is the way to end it, so it is no error.
absl::StatusOr<ExitCode> Hold(Session& session, std::optional<double> hold_seconds) {
  World& world = session.world();
  TimePoint end = kNever;
  if (hold_seconds) {
    end = world.clock.Now() + FromSeconds(*hold_seconds);
  } else if (world.in_is_terminal) {
    world.err << "the light stays on until Ctrl-C\n";
  } else {
    world.err << "lightstagectl: the light goes off again, as control is given back; keep it with "
                 "--hold SECONDS\n";
    return ExitCode::kOk;
  }
  world.interrupt.SleepUntil(end);
  RETURN_IF_ERROR(session.lost_control());
  return ExitCode::kOk;
}

std::string AtText(const v1::AxisState& axis) {
  return absl::StrCat("at ", NumberText(axis.position_deg()), " deg\n");
}

absl::StatusOr<ExitCode> Move(Session& session, const MoveFlags& flags) {
  ASSIGN_OR_RETURN(Connection * connection, session.Connect());
  ASSIGN_OR_RETURN(auto lease, session.TakeControl());
  v1::MoveAxisRequest request;
  request.set_control_token(lease->token());
  request.set_axis(flags.axis);
  request.set_target_deg(flags.target_deg);
  request.set_velocity_dps(flags.velocity_dps);
  ASSIGN_OR_RETURN(v1::MoveAxisResponse response,
                   Call(connection->rig(), &v1::RigService::Stub::MoveAxis, request,
                        session.world().interrupt, kMotionDeadline));
  RETURN_IF_ERROR(session.Print(response, [&] { return AtText(response.axis()); }));
  return ExitCode::kOk;
}

// A call that was ended has no answer: what the axis does then is asked for.
absl::StatusOr<v1::AxisState> StateAtRest(Session& session, v1::AxisId id) {
  ASSIGN_OR_RETURN(Connection * connection, session.Connect());
  Clock& clock = session.world().clock;
  Canceller never(clock);
  for (TimePoint give_up = clock.Now() + kStopPatience;;) {
    ASSIGN_OR_RETURN(v1::GetRigStateResponse response,
                     Call(connection->rig(), &v1::RigService::Stub::GetRigState, {}, never));
    for (const v1::AxisState& axis : response.state().axes()) {
      if (axis.axis() == id && !axis.moving()) return axis;
    }
    if (clock.Now() > give_up) {
      return Error(absl::StatusCode::kDeadlineExceeded, "STILL_MOVING",
                   absl::StrCat("the axis did not come to rest within ", Seconds(kStopPatience),
                                " s after it was told to stop; lightstagectl stop stops all"));
    }
    SleepFor(clock, std::chrono::milliseconds(50));
  }
}

absl::StatusOr<ExitCode> Jog(Session& session, const JogFlags& flags) {
  ASSIGN_OR_RETURN(Connection * connection, session.Connect());
  ASSIGN_OR_RETURN(auto lease, session.TakeControl());
  v1::JogAxisRequest request;
  request.set_control_token(lease->token());
  request.set_axis(flags.axis);
  request.set_velocity_dps(flags.velocity_dps);
  request.set_seconds(flags.seconds);
  absl::StatusOr<v1::JogAxisResponse> response =
      Call(connection->rig(), &v1::RigService::Stub::JogAxis, request, session.world().interrupt,
           kMotionDeadline + FromSeconds(flags.seconds));
  // Ctrl-C is the way to end it, so it is no error.
  if (session.world().interrupt.cancelled() && session.lost_control().ok()) {
    response.emplace();
    ASSIGN_OR_RETURN(*response->mutable_axis(), StateAtRest(session, flags.axis));
  }
  RETURN_IF_ERROR(response.status());
  RETURN_IF_ERROR(session.Print(*response, [&] { return AtText(response->axis()); }));
  return ExitCode::kOk;
}

absl::StatusOr<ExitCode> Lamps(Session& session, const LightFlags& flags) {
  ASSIGN_OR_RETURN(auto lease, session.TakeControl());
  ASSIGN_OR_RETURN(v1::SetLampsResponse response, SetLamps(session, *lease, flags.lamps));
  RETURN_IF_ERROR(session.Print(
      response, [&] { return absl::StrCat("lamps: ", LampsText(response.lamps()), "\n"); }));
  return flags.lamps.empty() ? ExitCode::kOk : Hold(session, flags.hold_seconds);
}

absl::StatusOr<ExitCode> Pattern(Session& session, const LightFlags& flags) {
  ASSIGN_OR_RETURN(auto lease, session.TakeControl());
  ASSIGN_OR_RETURN(v1::ShowPatternResponse response, ShowPattern(session, *lease, *flags.pattern));
  RETURN_IF_ERROR(session.Print(response, [&] {
    return absl::StrCat("projector: ", PatternText(response.pattern()), "\n");
  }));
  return flags.pattern->arrangement() == v1::PATTERN_ARRANGEMENT_BLACK
             ? ExitCode::kOk
             : Hold(session, flags.hold_seconds);
}

absl::StatusOr<ExitCode> Snap(Session& session, const SnapFlags& flags) {
  World& world = session.world();
  // Before anything lights up: a picture must not be lost to a misspelt folder.
  if (flags.out.empty()) return UsageError("--out names no file");
  size_t slash = flags.out.rfind('/');
  if (slash != std::string::npos && slash > 0 && !world.env.Exists(flags.out.substr(0, slash))) {
    return UsageError(
        absl::StrCat("there is no folder ", flags.out.substr(0, slash), " for --out"));
  }
  absl::Status there = world.env.FileSize(flags.out).status();
  if (!there.ok() && !absl::IsNotFound(there)) return there;
  ASSIGN_OR_RETURN(Connection * connection, session.Connect());
  ASSIGN_OR_RETURN(auto lease, session.TakeControl());
  if (!flags.light.lamps.empty()) {
    RETURN_IF_ERROR(SetLamps(session, *lease, flags.light.lamps).status());
  }
  if (flags.light.pattern) {
    RETURN_IF_ERROR(ShowPattern(session, *lease, *flags.light.pattern).status());
  }
  v1::SnapRequest request;
  request.set_control_token(lease->token());
  request.mutable_exposures_us()->Add(flags.exposures_us.begin(), flags.exposures_us.end());
  std::string file;
  v1::SnapResponse first;  // says what there is to say about the picture
  RETURN_IF_ERROR(ReadStream(connection->rig(), &v1::RigService::Stub::Snap, request,
                             world.interrupt, [&](const v1::SnapResponse& part) {
                               if (file.empty()) first = part;
                               file += part.data();
                               return true;
                             }));
  if (file.empty() || static_cast<int64_t>(file.size()) != first.total_bytes()) {
    return Error(absl::StatusCode::kDataLoss, "SIZE_MISMATCH",
                 absl::StrCat("the picture came with ", file.size(), " bytes instead of ",
                              first.total_bytes()),
                 {{"bytes", absl::StrCat(file.size())},
                  {"expected_bytes", absl::StrCat(first.total_bytes())}});
  }
  RETURN_IF_ERROR(world.env.WriteFile(flags.out, file));
  first.clear_data();  // it is in the file
  RETURN_IF_ERROR(session.Print(first, [&] {
    return absl::StrCat(flags.out, ": ", BytesText(first.total_bytes()), ", ",
                        NumberText(100 * first.saturated_share(), 2), " % saturated, ",
                        NumberText(100 * first.black_share(), 2), " % black\n",
                        AdjustedText(first.exposures()));
  }));
  return ExitCode::kOk;
}

absl::StatusOr<std::vector<v1::LampLevel>> ParseLampsOrOff(const std::string& text) {
  if (text == "off") return std::vector<v1::LampLevel>();
  return ParseLampLevels(text);
}

void AddHold(CLI::App& command, LightFlags& flags) {
  AddParsed(command, "--hold", flags.hold_seconds, ParseDuration, "SECONDS",
            "Keep the light for so long");
  command.footer(kHoldHelp);
}

}  // namespace

void AddManualCommands(CLI::App& app, Command& chosen) {
  // shared: CLI11 keeps the callbacks, which are copied
  auto move = std::make_shared<MoveFlags>();
  CLI::App* command =
      app.add_subcommand("move", "Moves one axis and waits until it has settled; Ctrl-C stops it");
  AddParsed(*command, "axis", move->axis, ParseAxis, "turntable|tilt", "Which axis")->required();
  AddParsed(*command, "target", move->target_deg, ParseNumber, "DEG", "Where to, degrees")
      ->required();
  AddParsed(*command, "--velocity-dps", move->velocity_dps, ParseNumber, "V",
            "Greatest speed, degrees per second; default: the axis' own");
  command->callback(
      [&chosen, move] { chosen = [move](Session& session) { return Move(session, *move); }; });

  auto jog = std::make_shared<JogFlags>();
  command = app.add_subcommand("jog", "Turns one axis until Ctrl-C, --for or its limit");
  AddParsed(*command, "axis", jog->axis, ParseAxis, "turntable|tilt", "Which axis")->required();
  AddParsed(*command, "velocity", jog->velocity_dps, ParseNumber, "V",
            "Degrees per second; below 0: the other way")
      ->required();
  AddParsed(*command, "--for", jog->seconds, ParseDuration, "SECONDS",
            "Turn so long; an hour at most, which is the default");
  command->callback(
      [&chosen, jog] { chosen = [jog](Session& session) { return Jog(session, *jog); }; });

  auto lamps = std::make_shared<LightFlags>();
  command = app.add_subcommand("lamps", "Lights lamps; those not named are dark");
  AddParsedWords(*command, "lamps", lamps->lamps, ParseLampsOrOff, "LAMP=LEVEL...|off",
                 "e.g. 3=1.0 7=0.5 or 0-19=0.5")
      ->required();
  AddHold(*command, *lamps);
  command->callback(
      [&chosen, lamps] { chosen = [lamps](Session& session) { return Lamps(session, *lamps); }; });

  auto pattern = std::make_shared<LightFlags>();
  command = app.add_subcommand("pattern", "Shows a pattern on the projector");
  AddParsedWords(*command, "pattern", pattern->pattern, ParsePattern, "PATTERN",
                 "black, full, square, horizontal or vertical, then any of grid=16 column=0 row=0 "
                 "influence=0 profile=box|gaussian|hat")
      ->required();
  AddHold(*command, *pattern);
  command->callback([&chosen, pattern] {
    chosen = [pattern](Session& session) { return Pattern(session, *pattern); };
  });

  auto snap = std::make_shared<SnapFlags>();
  command = app.add_subcommand("snap", "Takes one picture under the given light, else in the dark");
  command->add_option("--out", snap->out, "OpenEXR file to write")->type_name("F.exr")->required();
  AddParsed(*command, "--lamps", snap->light.lamps, ParseLampLevels, "LAMP=LEVEL,...",
            "Lamps to light for it");
  AddParsed(*command, "--pattern", snap->light.pattern, ParsePattern, "PATTERN,...",
            "Pattern to show for it, e.g. square,grid=16,column=3,row=4");
  AddParsed(*command, "--exposures-us", snap->exposures_us, ParseNumbers, "T,...",
            "Exposure bracket, microseconds, ascending; default: the rig's");
  command->callback(
      [&chosen, snap] { chosen = [snap](Session& session) { return Snap(session, *snap); }; });
}

}  // namespace lightstage::client
