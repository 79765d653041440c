#include "client/cli/plan_flags.h"

#include "base/status.h"
#include "base/strings.h"
#include "client/cli/messages.h"
#include "client/cli/options.h"

namespace lightstage::client {
namespace {

// gRPC refuses messages above 4 MiB without saying of what.
constexpr size_t kLargestPlan = 4'000'000;

void AddSharedFlags(CLI::App& program, PlanFlags& flags, const std::string& span) {
  AddParsed(program, "--azimuths", flags.azimuths, ParseCountOrAngles, "N|A,B,...",
            "Turntable positions: so many over " + span +
                " (default 32), or these angles in degrees if there is a comma or a decimal point");
  AddParsed(program, "--exposures-us", flags.exposures_us, ParseNumbers, "T,...",
            "Exposure bracket of every shot, microseconds, ascending; default: the rig's");
  AddParsed(program, "--dark-every", flags.dark_every, ParseInteger, "N",
            "A dark frame before the first, after every N and after the last basis image; 0: none");
  AddParsed(program, "--reference-every", flags.reference_every, ParseInteger, "N",
            "A frame with all light on, likewise");
}

void SetAngles(const CountOrAngles& angles, v1::AngleList* list) {
  for (double angle : std::get<std::vector<double>>(angles)) list->add_angles_deg(angle);
}

void SetLightStage(const PlanFlags& flags, v1::LightStage& stage) {
  if (std::holds_alternative<int>(flags.azimuths)) {
    stage.set_azimuths(std::get<int>(flags.azimuths));
  } else {
    SetAngles(flags.azimuths, stage.mutable_azimuth_list());
  }
  if (flags.span_deg) stage.set_span_deg(*flags.span_deg);
  stage.mutable_lamps()->Add(flags.lamps.begin(), flags.lamps.end());
  if (flags.level) stage.set_level(*flags.level);
  if (flags.tilt_deg) stage.set_tilt_deg(*flags.tilt_deg);
}

void SetProjector4d(const PlanFlags& flags, v1::Projector4d& projector) {
  if (std::holds_alternative<int>(flags.azimuths)) {
    projector.set_azimuths(std::get<int>(flags.azimuths));
  } else {
    SetAngles(flags.azimuths, projector.mutable_azimuth_list());
  }
  if (std::holds_alternative<int>(flags.tilts)) {
    projector.set_tilts(std::get<int>(flags.tilts));
  } else {
    SetAngles(flags.tilts, projector.mutable_tilt_list());
  }
  projector.set_grid(flags.grid);
  projector.set_profile(flags.profile);
  if (flags.influence) {
    projector.set_influence(*flags.influence);
  } else {
    projector.set_full(true);
  }
}

}  // namespace

void AddPlanFlags(CLI::App& command, PlanFlags& flags) {
  command.add_option("--plan", flags.file, "Any plan, as the JSON form of lightstage.v1.Plan")
      ->type_name("FILE.json");
  command.require_subcommand(0, 1);

  flags.light_stage =
      command.add_subcommand("light-stage", "Every lamp by itself at every turntable position");
  AddSharedFlags(*flags.light_stage, flags, "--span-deg degrees");
  AddParsed(*flags.light_stage, "--span-deg", flags.span_deg, ParseNumber, "DEG",
            "Range that a count of azimuths divides; default 180: each half of the brace covers "
            "one side");
  AddParsed(*flags.light_stage, "--lamps", flags.lamps, ParseLamps, "all|0-19|0,3,7-9",
            "Which lamps; default all");
  AddParsed(*flags.light_stage, "--level", flags.level, ParseNumber, "LEVEL",
            "Level of the lit lamp, above 0 to 1; default 1");
  AddParsed(*flags.light_stage, "--tilt-deg", flags.tilt_deg, ParseNumber, "DEG",
            "Where the projector's gantry stays; default: as near to 0 as the rig allows");

  flags.projector_4d = command.add_subcommand(
      "projector-4d", "Projector patterns at every gantry tilt and turntable position");
  AddSharedFlags(*flags.projector_4d, flags, "360 degrees");
  AddParsed(*flags.projector_4d, "--tilts", flags.tilts, ParseCountOrAngles, "N|A,B,...",
            "Gantry positions: so many over 90 degrees, cell-centred (default 7), or these angles");
  AddParsed(*flags.projector_4d, "--grid", flags.grid, ParseInteger, "M",
            "Squares per side of the pattern grid; default 16");
  AddParsed(*flags.projector_4d, "--pattern", flags.profile, ParseProfile, "box|gaussian|hat",
            "Shape of a square; default box");
  CLI::Option* influence =
      AddParsed(*flags.projector_4d, "--influence", flags.influence, ParseInteger, "D",
                "Horizontal and vertical patterns with D dark squares between lit ones");
  flags.projector_4d
      ->add_flag("--full", flags.full, "Every square by itself; what is done without --influence")
      ->excludes(influence);
}

absl::StatusOr<v1::Plan> MakePlan(const PlanFlags& flags, Env& env) {
  bool program = flags.light_stage->parsed() || flags.projector_4d->parsed();
  if (program == !flags.file.empty()) {
    return UsageError("give either light-stage, or projector-4d, or --plan FILE.json");
  }
  if (!program) {
    auto json = env.ReadInput(flags.file);
    if (!json.ok()) return UsageError(MessageOf(json.status()));
    auto plan = PlanFromJson(*json);
    if (!plan.ok()) {
      return UsageError(absl::StrCat(flags.file, ": ", MessageOf(plan.status())));
    }
    if (plan->ByteSizeLong() > kLargestPlan) {
      return UsageError(absl::StrCat(flags.file, ": the plan takes ", plan->ByteSizeLong(),
                                     " bytes, the daemon takes at most ", kLargestPlan));
    }
    return plan;
  }
  v1::Plan plan;
  plan.mutable_exposures_us()->Add(flags.exposures_us.begin(), flags.exposures_us.end());
  plan.set_dark_every(flags.dark_every);
  plan.set_reference_every(flags.reference_every);
  if (flags.light_stage->parsed()) {
    SetLightStage(flags, *plan.mutable_light_stage());
  } else {
    SetProjector4d(flags, *plan.mutable_projector_4d());
  }
  return plan;
}

}  // namespace lightstage::client
