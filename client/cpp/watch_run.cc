#include "client/cpp/watch_run.h"

#include "base/status.h"
#include "base/strings.h"

namespace lightstage::client {

bool HasEnded(v1::RunState state) {
  return state == v1::RUN_STATE_SUCCEEDED || state == v1::RUN_STATE_FAILED ||
         state == v1::RUN_STATE_CANCELLED || state == v1::RUN_STATE_INTERRUPTED;
}

absl::StatusOr<v1::Run> WatchRun(Connection& connection, const std::string& name,
                                 WatchOptions options, Canceller& canceller,
                                 absl::FunctionRef<bool(const v1::WatchRunResponse&)> on_update) {
  v1::WatchRunRequest request;
  request.set_name(name);
  if (options.shots_from) request.set_shots_from(*options.shots_from);
  request.set_min_interval_seconds(Seconds(options.min_interval));
  Retry retry(connection, canceller, options.patience, options.on_break);
  v1::Run run;
  bool enough = false;
  for (;;) {
    absl::Status status = ReadStream(connection.runs(), &v1::RunService::Stub::WatchRun, request,
                                     canceller, [&](const v1::WatchRunResponse& response) {
                                       retry.Progressed();
                                       run = response.run();
                                       if (request.has_shots_from()) {
                                         request.set_shots_from(response.next_shots_from());
                                       }
                                       enough = !on_update(response);
                                       return !enough;
                                     });
    if (enough) return run;
    if (status.ok()) {
      if (HasEnded(run.state())) return run;
      // A daemon that goes down in order ends its streams without an error.
      status = Error(absl::StatusCode::kUnavailable, kConnectionLost,
                     absl::StrCat("the daemon ended the watch of ", name, " before the run ended"),
                     {{"run", name}});
    }
    RETURN_IF_ERROR(retry.AfterBreak(status));
  }
}

}  // namespace lightstage::client
