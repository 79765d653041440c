// plan, capture

#include <memory>

#include "base/status.h"
#include "base/strings.h"
#include "base/utf8.h"
#include "client/cli/commands.h"
#include "client/cli/options.h"
#include "client/cli/plan_flags.h"
#include "client/cli/text.h"
#include "client/cli/watch.h"

namespace lightstage::client {
namespace {

struct CaptureFlags {
  PlanFlags plan;
  std::string name;
  bool detach = false;
  WatchFlags watch;
};

absl::StatusOr<ExitCode> Estimate(Session& session, const PlanFlags& flags) {
  v1::EstimateRunRequest request;
  ASSIGN_OR_RETURN(*request.mutable_plan(), MakePlan(flags, session.world().env));
  ASSIGN_OR_RETURN(Connection * connection, session.Connect());
  ASSIGN_OR_RETURN(v1::EstimateRunResponse estimate,
                   Call(connection->runs(), &v1::RunService::Stub::EstimateRun, request,
                        session.world().interrupt));
  RETURN_IF_ERROR(session.Print(estimate, [&] { return EstimateText(request.plan(), estimate); }));
  return ExitCode::kOk;
}

absl::StatusOr<ExitCode> Capture(Session& session, const CaptureFlags& flags) {
  v1::StartRunRequest request;
  ASSIGN_OR_RETURN(*request.mutable_plan(), MakePlan(flags.plan, session.world().env));
  request.set_display_name(flags.name);
  if (CleanUtf8(flags.name) != flags.name) return UsageError("--name is no UTF-8 text");
  ASSIGN_OR_RETURN(Connection * connection, session.Connect());
  v1::StartRunResponse response;
  {
    // A started run goes on without a lease. Giving it back lets others pause or cancel the run.
    ASSIGN_OR_RETURN(auto lease, session.TakeControl());
    request.set_control_token(lease->token());
    ASSIGN_OR_RETURN(response, Call(connection->runs(), &v1::RunService::Stub::StartRun, request,
                                    session.world().interrupt, kMotionDeadline));
  }
  const std::string& run = response.run().name();
  RETURN_IF_ERROR(session.Print(response, [&] { return absl::StrCat("started ", run, "\n"); }));
  if (!flags.detach) return WatchToEnd(session, run, flags.watch);
  session.world().err << "watch:  " << session.CommandLine("runs watch " + run) << "\n";
  return ExitCode::kOk;
}

}  // namespace

void AddPlanCommands(CLI::App& app, Command& chosen) {
  // shared: CLI11 keeps the callbacks, which are copied
  auto plan_flags = std::make_shared<PlanFlags>();
  CLI::App* plan = app.add_subcommand(
      "plan", "Dry run: counts shots, time and bytes and checks every limit; touches no device");
  AddPlanFlags(*plan, *plan_flags);
  plan->callback([&chosen, plan_flags] {
    chosen = [plan_flags](Session& session) { return Estimate(session, *plan_flags); };
  });

  auto flags = std::make_shared<CaptureFlags>();
  CLI::App* capture = app.add_subcommand(
      "capture", "Starts a run and shows how it goes; Ctrl-C detaches, the run goes on");
  AddPlanFlags(*capture, flags->plan);
  capture->add_option("--name", flags->name, "What to call the run; default: its id")
      ->type_name("NAME");
  capture->add_flag("--detach", flags->detach, "Only start the run");
  capture->add_flag("--through-pauses", flags->watch.through_pauses,
                    "Stay while the run is paused, instead of ending with exit code 4");
  capture->callback([&chosen, flags] {
    chosen = [flags](Session& session) { return Capture(session, *flags); };
  });
}

}  // namespace lightstage::client
