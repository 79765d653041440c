// runs list | show | watch | pause | resume | cancel | verify | fetch

#include <memory>
#include <utility>

#include "base/status.h"
#include "base/strings.h"
#include "client/cli/commands.h"
#include "client/cli/options.h"
#include "client/cli/progress_line.h"
#include "client/cli/text.h"
#include "client/cli/values.h"
#include "client/cli/watch.h"
#include "client/cpp/fetch_run.h"

namespace lightstage::client {
namespace {

struct RunsFlags {
  std::string run;
  WatchFlags watch;
  std::string folder;
};

absl::StatusOr<ExitCode> List(Session& session) {
  ASSIGN_OR_RETURN(Connection * connection, session.Connect());
  v1::ListRunsRequest request;
  request.set_page_size(1000);
  v1::ListRunsResponse all;
  do {
    ASSIGN_OR_RETURN(v1::ListRunsResponse page,
                     Call(connection->runs(), &v1::RunService::Stub::ListRuns, request,
                          session.world().interrupt));
    request.set_page_token(page.next_page_token());
    page.clear_next_page_token();
    all.MergeFrom(page);
  } while (!request.page_token().empty());
  RETURN_IF_ERROR(session.Print(all, [&] { return RunsText(all); }));
  return ExitCode::kOk;
}

// The resource name of the run that the user named.
absl::StatusOr<std::string> Resolve(Session& session, const std::string& run) {
  if (run != kLatestRun) return run;
  ASSIGN_OR_RETURN(Connection * connection, session.Connect());
  v1::ListRunsRequest request;
  request.set_page_size(1);
  ASSIGN_OR_RETURN(v1::ListRunsResponse page,
                   Call(connection->runs(), &v1::RunService::Stub::ListRuns, request,
                        session.world().interrupt));
  if (!page.runs().empty()) return page.runs(0).name();
  return Error(absl::StatusCode::kNotFound, "RUN_NOT_FOUND", "there is no run yet");
}

absl::StatusOr<ExitCode> Show(Session& session, const RunsFlags& flags) {
  v1::GetRunRequest request;
  ASSIGN_OR_RETURN(*request.mutable_name(), Resolve(session, flags.run));
  ASSIGN_OR_RETURN(Connection * connection, session.Connect());
  ASSIGN_OR_RETURN(
      v1::GetRunResponse response,
      Call(connection->runs(), &v1::RunService::Stub::GetRun, request, session.world().interrupt));
  RETURN_IF_ERROR(session.Print(response, [&] { return RunText(response.run()); }));
  return ExitCode::kOk;
}

absl::StatusOr<ExitCode> Watch(Session& session, const RunsFlags& flags) {
  ASSIGN_OR_RETURN(std::string name, Resolve(session, flags.run));
  return WatchToEnd(session, name, flags.watch);
}

// Pause, resume and cancel: one call under control.
template <class Request, class Response>
absl::StatusOr<ExitCode> Steer(Session& session, const RunsFlags& flags,
                               grpc::Status (v1::RunService::Stub::*method)(grpc::ClientContext*,
                                                                            const Request&,
                                                                            Response*)) {
  Request request;
  ASSIGN_OR_RETURN(*request.mutable_name(), Resolve(session, flags.run));
  ASSIGN_OR_RETURN(Connection * connection, session.Connect());
  ASSIGN_OR_RETURN(auto lease, session.TakeControl());
  request.set_control_token(lease->token());
  ASSIGN_OR_RETURN(Response response, Call(connection->runs(), method, request,
                                           session.world().interrupt, kMotionDeadline));
  RETURN_IF_ERROR(session.Print(response, [&] {
    return absl::StrCat(response.run().name(), " is ", StateText(response.run().state()), "\n");
  }));
  return ExitCode::kOk;
}

absl::StatusOr<ExitCode> Verify(Session& session, const RunsFlags& flags) {
  v1::VerifyRunRequest request;
  ASSIGN_OR_RETURN(*request.mutable_name(), Resolve(session, flags.run));
  ASSIGN_OR_RETURN(Connection * connection, session.Connect());
  ProgressLine progress(session.world());
  int checked = 0, total = 0, problems = 0;
  absl::Status printed;
  RETURN_IF_ERROR(ReadStream(
      connection->runs(), &v1::RunService::Stub::VerifyRun, request, session.world().interrupt,
      [&](const v1::VerifyRunResponse& response) {
        checked = response.checked_files();
        total = response.total_files();
        problems += response.problems_size();
        if (session.json() || response.problems_size() > 0) {
          progress.Clear();
          printed = session.Print(response, [&] {
            std::string text;
            for (const v1::VerifyProblem& problem : response.problems()) {
              absl::StrAppend(&text, problem.file(), ": ", ReasonText(problem.reason()), "\n");
            }
            return text;
          });
        }
        if (!session.json() && response.total_files() > 0) {
          progress.Show(static_cast<double>(checked) / response.total_files(),
                        absl::StrCat(checked, "/", response.total_files(), " files"));
        }
        return printed.ok();
      }));
  RETURN_IF_ERROR(printed);
  progress.Clear();
  if (checked < total) {
    return Error(
        absl::StatusCode::kInternal, "VERIFY_INCOMPLETE",
        absl::StrCat("the daemon ended the verification after ", checked, " of ", total, " files"),
        {{"checked", absl::StrCat(checked)}, {"total", absl::StrCat(total)}});
  }
  if (!session.json()) {
    session.world().out << checked << " files checked, "
                        << (problems == 0 ? "no" : absl::StrCat(problems)) << " problem"
                        << (problems == 1 ? "" : "s") << std::endl;
  }
  return problems == 0 ? ExitCode::kOk : ExitCode::kDamaged;
}

absl::StatusOr<ExitCode> Fetch(Session& session, const RunsFlags& flags) {
  World& world = session.world();
  ASSIGN_OR_RETURN(std::string name, Resolve(session, flags.run));
  ASSIGN_OR_RETURN(Connection * connection, session.Connect());
  ProgressLine progress(world);
  absl::Status printed;
  FetchOptions options;
  options.on_break = [&](const absl::Status& status) {
    progress.Clear();
    world.err << "lightstagectl: " << MessageOf(status) << "; trying again\n";
  };
  ASSIGN_OR_RETURN(
      FetchResult result,
      FetchRun(*connection, name, flags.folder, world.env, std::move(options), world.interrupt,
               [&](const v1::DatasetFile& file, const FetchProgress& p) {
                 if (session.json()) {
                   if (printed.ok()) printed = session.Print(file, [] { return ""; });
                   return;
                 }
                 double share = p.total_bytes > 0
                                    ? static_cast<double>(p.done_bytes) / p.total_bytes
                                    : static_cast<double>(p.done_files()) / p.total_files;
                 progress.Show(share, absl::StrCat(p.done_files(), "/", p.total_files, " files  ",
                                                   BytesText(p.done_bytes), " of ",
                                                   BytesText(p.total_bytes)));
               }));
  progress.Clear();
  RETURN_IF_ERROR(printed);
  for (const FetchProblem& problem : result.problems) {
    world.err << "lightstagectl: " << MessageOf(problem.status) << " ["
              << ErrorReason(problem.status) << "]\n";
  }
  if (!session.json()) {
    world.out << result.progress.fetched_files << " files fetched to " << flags.folder << ", "
              << result.progress.skipped_files << " were there, " << result.progress.bad_files
              << " damaged" << std::endl;
  }
  return result.problems.empty() ? ExitCode::kOk : ExitCode::kDamaged;
}

// A subcommand on one run.
CLI::App* AddRunCommand(CLI::App& runs, const std::string& name, const std::string& description,
                        const std::shared_ptr<RunsFlags>& flags, Command& chosen,
                        absl::StatusOr<ExitCode> (*act)(Session&, const RunsFlags&)) {
  CLI::App* command = runs.add_subcommand(name, description);
  AddParsed(*command, "run", flags->run, ParseRun, "RUN", "The run: its name, or latest")
      ->required();
  command->callback([&chosen, flags, act] {
    chosen = [flags, act](Session& session) { return act(session, *flags); };
  });
  return command;
}

}  // namespace

void AddRunsCommands(CLI::App& app, Command& chosen) {
  CLI::App* runs = app.add_subcommand("runs", "The captures in the daemon's data directory");
  runs->require_subcommand(1);
  runs->add_subcommand("list", "All runs, newest first")->callback([&chosen] { chosen = List; });

  auto flags = std::make_shared<RunsFlags>();  // shared: CLI11 copies the callbacks
  AddRunCommand(*runs, "show", "One run", flags, chosen, Show);
  CLI::App* watch = AddRunCommand(
      *runs, "watch", "Shows how a run goes until it ends; Ctrl-C detaches, the run goes on", flags,
      chosen, Watch);
  watch->add_flag("--through-pauses", flags->watch.through_pauses,
                  "Stay while the run is paused, instead of ending with exit code 4");
  AddParsed(*watch, "--shots-from", flags->watch.shots_from, ParseInteger, "N",
            "Print every stored shot too, from the Nth on (0: all)");
  AddRunCommand(
      *runs, "pause", "Pauses at the next shot, dark", flags, chosen,
      [](Session& s, const RunsFlags& f) { return Steer(s, f, &v1::RunService::Stub::PauseRun); });
  AddRunCommand(
      *runs, "resume", "Continues a paused or interrupted run", flags, chosen,
      [](Session& s, const RunsFlags& f) { return Steer(s, f, &v1::RunService::Stub::ResumeRun); });
  AddRunCommand(
      *runs, "cancel", "Ends a run for good; what is stored stays", flags, chosen,
      [](Session& s, const RunsFlags& f) { return Steer(s, f, &v1::RunService::Stub::CancelRun); });
  AddRunCommand(*runs, "verify", "Checks every file of a run against its checksum", flags, chosen,
                Verify);
  CLI::App* fetch = AddRunCommand(
      *runs, "fetch",
      "Copies a run's files to a folder here; what is there already is not sent again", flags,
      chosen, Fetch);
  fetch->add_option("folder", flags->folder, "Where to; created if needed")
      ->type_name("DIR")
      ->required();
}

}  // namespace lightstage::client
