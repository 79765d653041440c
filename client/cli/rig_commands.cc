// status, rig, stop, reset

#include <memory>

#include "base/status.h"
#include "client/cli/commands.h"
#include "client/cli/options.h"
#include "client/cli/text.h"

namespace lightstage::client {
namespace {

absl::StatusOr<ExitCode> Status(Session& session) {
  ASSIGN_OR_RETURN(Connection * connection, session.Connect());
  ASSIGN_OR_RETURN(
      v1::GetRigStateResponse response,
      Call(connection->rig(), &v1::RigService::Stub::GetRigState, {}, session.world().interrupt));
  RETURN_IF_ERROR(session.Print(response, [&] { return RigStateText(response.state()); }));
  return ExitCode::kOk;
}

// Until Ctrl-C, which is the way to end it.
absl::StatusOr<ExitCode> WatchStatus(Session& session) {
  ASSIGN_OR_RETURN(Connection * connection, session.Connect());
  absl::Status printed;
  absl::Status status = ReadStream(
      connection->rig(), &v1::RigService::Stub::WatchRigState, {}, session.world().interrupt,
      [&](const v1::WatchRigStateResponse& response) {
        printed = session.Print(response, [&] { return RigStateText(response.state()) + "\n"; });
        return printed.ok();
      });
  RETURN_IF_ERROR(printed);
  if (session.world().interrupt.cancelled()) return ExitCode::kOk;
  RETURN_IF_ERROR(status);
  return ExitCode::kOk;
}

absl::StatusOr<ExitCode> Rig(Session& session) {
  ASSIGN_OR_RETURN(Connection * connection, session.Connect());
  ASSIGN_OR_RETURN(
      v1::GetRigResponse response,
      Call(connection->rig(), &v1::RigService::Stub::GetRig, {}, session.world().interrupt));
  RETURN_IF_ERROR(session.Print(response, [&] { return RigText(response.rig()); }));
  return ExitCode::kOk;
}

absl::StatusOr<ExitCode> Stop(Session& session) {
  ASSIGN_OR_RETURN(Connection * connection, session.Connect());
  v1::StopRigRequest request;
  request.set_note(session.options().note);
  ASSIGN_OR_RETURN(
      v1::StopRigResponse response,
      Call(connection->rig(), &v1::RigService::Stub::StopRig, request, session.world().interrupt));
  RETURN_IF_ERROR(session.Print(response, [&] { return RigStateText(response.state()); }));
  return ExitCode::kOk;
}

absl::StatusOr<ExitCode> Reset(Session& session) {
  ASSIGN_OR_RETURN(Connection * connection, session.Connect());
  ASSIGN_OR_RETURN(auto lease, session.TakeControl());
  v1::ResetRigRequest request;
  request.set_control_token(lease->token());
  ASSIGN_OR_RETURN(v1::ResetRigResponse response,
                   Call(connection->rig(), &v1::RigService::Stub::ResetRig, request,
                        session.world().interrupt, kMotionDeadline));
  RETURN_IF_ERROR(session.Print(response, [&] { return RigStateText(response.state()); }));
  return ExitCode::kOk;
}

}  // namespace

void AddRigCommands(CLI::App& app, Command& chosen) {
  auto watch = std::make_shared<bool>(false);  // shared: CLI11 copies the callback
  CLI::App* status = app.add_subcommand("status", "What the rig does now and who has control");
  status->add_flag("--watch", *watch, "Again after every change, until Ctrl-C");
  status->callback([&chosen, watch] { chosen = *watch ? WatchStatus : Status; });
  app.add_subcommand("rig", "What the rig is made of")->callback([&chosen] { chosen = Rig; });
  app.add_subcommand("stop",
                     "Stops all motion and light at once, whoever has control, until reset; a run "
                     "is paused")
      ->callback([&chosen] { chosen = Stop; });
  app.add_subcommand("reset", "Ends a stop and homes the axes")->callback([&chosen] {
    chosen = Reset;
  });
}

}  // namespace lightstage::client
