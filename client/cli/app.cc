#include "client/cli/app.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_join.h"
#include "base/status.h"
#include "base/strings.h"
#include "base/utf8.h"
#include "base/version.h"
#include "client/cli/commands.h"
#include "client/cli/options.h"
#include "client/cli/values.h"

namespace lightstage::client {
namespace {

constexpr char kFooter[] = R"(
Addresses are unix:PATH, HOST:PORT or [IPV6]:PORT. Global options may also stand after the command.
With --format json standard output carries the API's answers as JSON, one a line, and nothing else.

Exit codes:
  0    done
  1    the daemon or this machine refused or failed
  2    the command line, or a file given in it, cannot be read
  3    the daemon cannot be reached
  4    the watched run is paused, interrupted, cancelled or failed
  5    verify or fetch found damaged files
  130  interrupted by Ctrl-C; a started run goes on)";

// Lengths that the API takes.
constexpr size_t kLongestOwner = 200;
constexpr size_t kLongestNote = 500;

// What is shown to others; a command line may hold file names that are no UTF-8.
std::string Shown(const std::string& text, size_t bytes) { return CutUtf8(CleanUtf8(text), bytes); }

absl::StatusOr<bool> ParseFormat(const std::string& text) {
  if (text == "json") return true;
  if (text == "text") return false;
  return UsageError(absl::StrCat("'", text, "' is no format: give text or json"));
}

// So that global options are taken after the command too.
void LetOptionsFallThrough(CLI::App& app) {
  for (CLI::App* command : app.get_subcommands([](CLI::App*) { return true; })) {
    command->fallthrough();
    LetOptionsFallThrough(*command);
  }
}

ExitCode CodeOf(const absl::Status& status) {
  std::string reason = ErrorReason(status);
  if (reason == "USAGE" || reason == "ADDRESS_INVALID") return ExitCode::kUsage;
  if (reason == kCannotConnect || reason == kConnectionLost) return ExitCode::kNoConnection;
  if (reason == kCancelled) return ExitCode::kInterrupted;
  return ExitCode::kError;
}

}  // namespace

ExitCode RunCli(const std::vector<std::string>& arguments, World& world) {
  CLI::App app("Controls a relighting rig through its daemon, lightstaged.", "lightstagectl");
  app.set_version_flag("--version", std::string("lightstagectl ") + kVersion);
  app.require_subcommand(1);
  app.failure_message([](const CLI::App*, const CLI::Error& error) {
    return absl::StrCat("lightstagectl: ", error.what(),
                        "\nRun with --help for more information.\n");
  });

  GlobalOptions options;
  options.address = DefaultAddress();
  options.owner = DefaultOwner();
  options.note = absl::StrCat("lightstagectl ", absl::StrJoin(arguments, " "));
  app.add_option("--address", options.address,
                 "Where the daemon listens; default: $LIGHTSTAGE_ADDRESS, else 127.0.0.1:7420")
      ->take_last();
  AddParsed(app, "--format", options.json, ParseFormat, "text|json", "How answers are written")
      ->take_last();
  AddParsed(app, "--wait", options.wait_seconds, ParseDuration, "SECONDS",
            "Keep trying to connect for so long; default: fail when the daemon refuses");
  app.add_option("--owner", options.owner,
                 "Who takes control, shown to others; default: user@host (process)");
  app.add_option("--note", options.note, "What for, shown to others; default: the command line");

  Command chosen;
  AddRigCommands(app, chosen);
  AddPlanCommands(app, chosen);
  AddRunsCommands(app, chosen);
  AddManualCommands(app, chosen);
  app.footer(kFooter);  // after the commands, which would inherit it
  LetOptionsFallThrough(app);
  try {
    app.parse(std::vector<std::string>(arguments.rbegin(), arguments.rend()));
  } catch (const CLI::ParseError& error) {
    // --help and --version come as "errors" with code 0.
    return app.exit(error, world.out, world.err) == 0 ? ExitCode::kOk : ExitCode::kUsage;
  }
  options.owner = Shown(options.owner, kLongestOwner);
  options.note = Shown(options.note, kLongestNote);

  Session session(world, std::move(options));
  absl::StatusOr<ExitCode> code = chosen(session);
  if (code.ok()) return *code;
  absl::Status status = code.status();
  // Losing control interrupts what was going on: that it was lost is the news.
  if (ErrorReason(status) == kCancelled && !session.lost_control().ok()) {
    status = session.lost_control();
  }
  if (ErrorReason(status) == kCancelled) {
    world.err << "lightstagectl: interrupted\n";
  } else if (ErrorReason(status) == "USAGE") {
    world.err << "lightstagectl: " << MessageOf(status) << "\n";
  } else {
    world.err << "lightstagectl: " << MessageOf(status) << " [" << ErrorReason(status) << "]\n";
  }
  return CodeOf(status);
}

}  // namespace lightstage::client
