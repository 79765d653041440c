#include "client/cli/watch.h"

#include <utility>

#include "absl/strings/str_format.h"
#include "base/status.h"
#include "base/strings.h"
#include "client/cli/progress_line.h"
#include "client/cli/text.h"
#include "client/cpp/watch_run.h"

namespace lightstage::client {
namespace {

// For scripts that read JSON: often enough to steer by, seldom enough to keep.
constexpr Duration kJsonInterval = std::chrono::milliseconds(500);

double Share(const v1::Run& run) {
  return run.total_shots() > 0 ? static_cast<double>(run.done_shots()) / run.total_shots() : 0;
}

// What fits beside the bar: the state first if it is not the usual one.
std::string ProgressText(const v1::Run& run) {
  std::string text = absl::StrCat(run.done_shots(), "/", run.total_shots());
  if (run.state() != v1::RUN_STATE_RUNNING) absl::StrAppend(&text, " ", StateText(run.state()));
  if (run.shots_per_second() > 0) {
    absl::StrAppend(&text, "  ", absl::StrFormat("%.1f", run.shots_per_second()), "/s  ",
                    DurationText(run.remaining_seconds()), " left");
  }
  absl::StrAppend(&text, "  az ", NumberText(run.pose().azimuth_deg(), 2), " tilt ",
                  NumberText(run.pose().tilt_deg(), 2));
  return text;
}

// True if nothing will happen before somebody does something.
bool IsWaiting(v1::RunState state) {
  return state == v1::RUN_STATE_PAUSED || state == v1::RUN_STATE_INTERRUPTED;
}

void PrintHint(Session& session, const v1::Run& run) {
  if (!IsWaiting(run.state())) return;
  session.world().err << "go on:  " << session.CommandLine("runs resume " + run.name()) << "\n"
                      << "watch:  " << session.CommandLine("runs watch " + run.name()) << "\n";
}

}  // namespace

absl::StatusOr<ExitCode> WatchToEnd(Session& session, const std::string& run_name,
                                    const WatchFlags& flags) {
  World& world = session.world();
  ASSIGN_OR_RETURN(Connection * connection, session.Connect());
  ProgressLine progress(world);
  v1::Run last;
  absl::Status failed_print;

  WatchOptions options;
  options.shots_from = flags.shots_from;
  if (session.json()) options.min_interval = kJsonInterval;
  bool connected = true;
  options.on_break = [&](const absl::Status& status) {
    if (std::exchange(connected, false)) {
      progress.Clear();
      world.err << "lightstagectl: " << MessageOf(status) << "; trying again\n";
    }
  };
  absl::StatusOr<v1::Run> end =
      WatchRun(*connection, run_name, std::move(options), world.interrupt,
               [&](const v1::WatchRunResponse& response) {
                 connected = true;
                 bool changed = last.name().empty() || response.run().state() != last.state();
                 last = response.run();
                 if (session.json() || response.shots_size() > 0) {
                   progress.Clear();
                   failed_print = session.Print(response, [&] {
                     std::string text;
                     for (const v1::Shot& shot : response.shots()) text += ShotText(shot) + "\n";
                     return text;
                   });
                   if (!failed_print.ok()) return false;
                 }
                 if (!session.json()) progress.Show(Share(last), ProgressText(last), changed);
                 return flags.through_pauses || !IsWaiting(last.state());
               });
  progress.Clear();
  RETURN_IF_ERROR(failed_print);
  if (!end.ok()) {
    if (world.interrupt.cancelled()) {
      world.err << "detached; the run goes on. Watch it again:\n  "
                << session.CommandLine("runs watch " + run_name) << "\n";
      return ExitCode::kInterrupted;
    }
    if (!last.name().empty()) {
      world.err << "the run may go on. Watch it again:\n  "
                << session.CommandLine("runs watch " + run_name) << "\n";
    }
    return end.status();
  }
  if (!session.json()) {
    RETURN_IF_ERROR(session.Print(*end, [&] { return RunText(*end); }));
  } else if (end->has_reason()) {
    world.err << "lightstagectl: " << run_name << " is " << StateText(end->state()) << ": "
              << ReasonText(end->reason()) << "\n";
  }
  PrintHint(session, *end);
  return end->state() == v1::RUN_STATE_SUCCEEDED ? ExitCode::kOk : ExitCode::kRunNotDone;
}

}  // namespace lightstage::client
