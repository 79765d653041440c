#include "daemon/rpc/run_service.h"

#include "absl/strings/str_format.h"
#include "absl/time/clock.h"
#include "base/status.h"
#include "base/utf8.h"
#include "daemon/capture/estimate.h"
#include "daemon/rpc/chunks.h"
#include "daemon/rpc/convert.h"
#include "daemon/rpc/errors.h"
#include "daemon/rpc/names.h"
#include "daemon/store/verify.h"
#include "google/protobuf/util/time_util.h"

namespace lightstage::rpc {
namespace {

v1::RunState StateToMessage(RunState state) {
  switch (state) {
    case RunState::kRunning:
      return v1::RUN_STATE_RUNNING;
    case RunState::kPausing:
      return v1::RUN_STATE_PAUSING;
    case RunState::kPaused:
      return v1::RUN_STATE_PAUSED;
    case RunState::kCancelling:
      return v1::RUN_STATE_CANCELLING;
    case RunState::kCancelled:
      return v1::RUN_STATE_CANCELLED;
    case RunState::kSucceeded:
      return v1::RUN_STATE_SUCCEEDED;
    case RunState::kFailed:
      return v1::RUN_STATE_FAILED;
    case RunState::kInterrupted:
      return v1::RUN_STATE_INTERRUPTED;
  }
  return v1::RUN_STATE_UNSPECIFIED;
}

constexpr uint64_t kMostShotsInAnswer = 1000;

}  // namespace

RunService::RunService(RunManager& runs, const RigFacts& facts, Control& control)
    : runs_(runs), facts_(facts), control_(control) {}

v1::Run RunService::ToMessage(const RunView& view) const {
  v1::Run run;
  run.set_name(RunName(view.id));
  run.set_display_name(view.name);
  run.set_state(StateToMessage(view.state));
  if (!view.reason.ok()) *run.mutable_reason() = ToReason(view.reason);
  if (auto plan = PlanFromJson(view.plan_json, lamp_count()); plan.ok())
    *run.mutable_plan() = rpc::ToMessage(*plan);
  run.set_total_shots(static_cast<int>(view.total_shots));
  run.set_done_shots(static_cast<int>(view.done_shots));
  run.set_retakes(static_cast<int>(view.retakes));
  run.set_dark_basis_shots(static_cast<int>(view.nothing_seen));
  run.set_stored_bytes(static_cast<int64_t>(view.stored_bytes));
  *run.mutable_pose() = rpc::ToMessage(view.pose);
  run.set_shots_per_second(view.shots_per_second);
  run.set_remaining_seconds(view.remaining_seconds);
  using google::protobuf::util::TimeUtil;
  TimeUtil::FromString(view.created_at, run.mutable_create_time());
  if (!view.ended_at.empty()) TimeUtil::FromString(view.ended_at, run.mutable_end_time());
  run.set_directory(view.directory);
  return run;
}

absl::Status RunService::FillRun(const std::string& id, v1::Run* run) {
  ASSIGN_OR_RETURN(RunView view, runs_.Get(id));
  *run = ToMessage(view);
  return absl::OkStatus();
}

grpc::Status RunService::EstimateRun(grpc::ServerContext*, const v1::EstimateRunRequest* request,
                                     v1::EstimateRunResponse* response) {
  auto estimate = [&]() -> absl::StatusOr<Estimate> {
    ASSIGN_OR_RETURN(Plan plan, FromMessage(request->plan(), lamp_count()));
    return EstimatePlan(plan, facts_);
  }();
  if (!estimate.ok()) return ToGrpc(estimate.status());
  response->set_shots(static_cast<int>(estimate->shots));
  response->set_extra_shots(static_cast<int>(estimate->extra_shots));
  response->set_exposures(static_cast<int>(estimate->exposures));
  response->set_positions(static_cast<int>(estimate->positions));
  response->set_duration_seconds(estimate->duration_seconds);
  response->set_bytes(estimate->bytes);
  auto free_bytes = runs_.FreeBytes();
  if (!free_bytes.ok()) return ToGrpc(free_bytes.status());
  response->set_free_bytes(static_cast<int64_t>(*free_bytes));
  for (const std::string& note : estimate->notes) response->add_notes(note);
  absl::Status room = runs_.CheckRoom(static_cast<uint64_t>(estimate->bytes));
  if (!room.ok()) response->add_notes(MessageOf(room));
  return grpc::Status::OK;
}

grpc::Status RunService::StartRun(grpc::ServerContext*, const v1::StartRunRequest* request,
                                  v1::StartRunResponse* response) {
  auto started = [&]() -> absl::Status {
    RETURN_IF_ERROR(control_.Check(request->control_token()));
    ASSIGN_OR_RETURN(Plan plan, FromMessage(request->plan(), lamp_count()));
    ASSIGN_OR_RETURN(std::string id, runs_.Start(plan, request->display_name()));
    return FillRun(id, response->mutable_run());
  };
  return ToGrpc(started());
}

grpc::Status RunService::GetRun(grpc::ServerContext*, const v1::GetRunRequest* request,
                                v1::GetRunResponse* response) {
  auto id = RunId(request->name());
  if (!id.ok()) return ToGrpc(id.status());
  return ToGrpc(FillRun(*id, response->mutable_run()));
}

grpc::Status RunService::ListRuns(grpc::ServerContext*, const v1::ListRunsRequest* request,
                                  v1::ListRunsResponse* response) {
  auto runs = runs_.List();
  if (!runs.ok()) return ToGrpc(runs.status());
  auto page = PageOf(runs->size(), request->page_size(), 100, 1000, request->page_token());
  if (!page.ok()) return ToGrpc(page.status());
  for (uint64_t i = page->first; i < page->last; ++i) *response->add_runs() = ToMessage((*runs)[i]);
  response->set_next_page_token(page->next_token);
  return grpc::Status::OK;
}

absl::Status RunService::Change(const std::string& name, const std::string& token,
                                absl::Status (RunManager::*change)(const std::string&),
                                v1::Run* after) {
  ASSIGN_OR_RETURN(std::string id, RunId(name));
  RETURN_IF_ERROR(control_.Check(token));
  RETURN_IF_ERROR((runs_.*change)(id));
  return FillRun(id, after);
}

grpc::Status RunService::PauseRun(grpc::ServerContext*, const v1::PauseRunRequest* request,
                                  v1::PauseRunResponse* response) {
  return ToGrpc(Change(request->name(), request->control_token(), &RunManager::Pause,
                       response->mutable_run()));
}

grpc::Status RunService::ResumeRun(grpc::ServerContext*, const v1::ResumeRunRequest* request,
                                   v1::ResumeRunResponse* response) {
  return ToGrpc(Change(request->name(), request->control_token(), &RunManager::Resume,
                       response->mutable_run()));
}

grpc::Status RunService::CancelRun(grpc::ServerContext*, const v1::CancelRunRequest* request,
                                   v1::CancelRunResponse* response) {
  return ToGrpc(Change(request->name(), request->control_token(), &RunManager::Cancel,
                       response->mutable_run()));
}

grpc::Status RunService::WatchRun(grpc::ServerContext* context, const v1::WatchRunRequest* request,
                                  grpc::ServerWriter<v1::WatchRunResponse>* writer) {
  auto watched = [&]() -> absl::Status {
    ASSIGN_OR_RETURN(std::string id, RunId(request->name()));
    ASSIGN_OR_RETURN(Duration interval, WatchInterval(request->min_interval_seconds()));
    if (request->shots_from() < 0) {
      return Error(absl::StatusCode::kInvalidArgument, "SHOTS_FROM",
                   absl::StrFormat("shots_from is %d; it must be >= 0", request->shots_from()),
                   {{"shots_from", absl::StrCat(request->shots_from())}});
    }
    // Records stay in the folder, so a slow reader has a place in them and holds up nobody.
    uint64_t next = request->shots_from();
    std::string last;
    while (!context->IsCancelled() && !closed_) {
      // The state first: when it says that the run has ended, the records read after it are all there are.
      ASSIGN_OR_RETURN(RunView view, runs_.Get(id));
      v1::WatchRunResponse response;
      *response.mutable_run() = ToMessage(view);
      bool more = false;
      if (request->has_shots_from()) {
        ASSIGN_OR_RETURN(auto folder, runs_.Folder(id));
        const uint64_t end = std::min<uint64_t>(next + kMostShotsInAnswer, folder->positions());
        for (const ShotRecord& record : folder->Records(next, end > next ? end - next : 0))
          *response.add_shots() = rpc::ToMessage(record);
        more = end == next + kMostShotsInAnswer;
        next = std::max(next, end);
        response.set_next_shots_from(static_cast<int>(next));
      }
      std::string now = response.SerializeAsString();
      if (now != last && !writer->Write(response)) break;
      last = std::move(now);
      if (more) continue;
      if (IsTerminal(view.state) || view.state == RunState::kInterrupted) break;
      SleepUnless(interval, [&] { return context->IsCancelled() || closed_; });
    }
    return absl::OkStatus();
  };
  return ToGrpc(watched());
}

grpc::Status RunService::ListShots(grpc::ServerContext*, const v1::ListShotsRequest* request,
                                   v1::ListShotsResponse* response) {
  auto listed = [&]() -> absl::Status {
    ASSIGN_OR_RETURN(std::string id, RunId(request->parent()));
    ASSIGN_OR_RETURN(auto folder, runs_.Folder(id));
    ASSIGN_OR_RETURN(Page page, PageOf(folder->positions(), request->page_size(), 100, 1000,
                                       request->page_token()));
    for (const ShotRecord& record : folder->Records(page.first, page.last - page.first))
      *response->add_shots() = rpc::ToMessage(record);
    response->set_next_page_token(page.next_token);
    return absl::OkStatus();
  };
  return ToGrpc(listed());
}

grpc::Status RunService::VerifyRun(grpc::ServerContext* context,
                                   const v1::VerifyRunRequest* request,
                                   grpc::ServerWriter<v1::VerifyRunResponse>* writer) {
  auto verified = [&]() -> absl::Status {
    ASSIGN_OR_RETURN(std::string id, RunId(request->name()));
    ASSIGN_OR_RETURN(auto folder, runs_.Reread(id));
    v1::VerifyRunResponse response;
    absl::Time sent = absl::InfinitePast();
    bool gone = false;
    auto send = [&] {
      gone |= !writer->Write(response);
      response.clear_problems();
      sent = absl::Now();
    };
    VerifyHooks hooks;
    hooks.progress = [&](uint64_t checked, uint64_t total) {
      response.set_checked_files(static_cast<int>(checked));
      response.set_total_files(static_cast<int>(total));
      if (absl::Now() - sent > absl::Milliseconds(100)) send();
    };
    hooks.problem = [&](const VerifyProblem& problem) {
      v1::VerifyProblem* p = response.add_problems();
      p->set_file(CleanUtf8(problem.file));
      *p->mutable_reason() = ToReason(problem.reason);
    };
    hooks.cancelled = [&] { return gone || closed_ || context->IsCancelled(); };
    RETURN_IF_ERROR(Verify(*folder, hooks).status());
    send();
    return absl::OkStatus();
  };
  return ToGrpc(verified());
}

grpc::Status RunService::ListFiles(grpc::ServerContext*, const v1::ListFilesRequest* request,
                                   v1::ListFilesResponse* response) {
  auto listed = [&]() -> absl::Status {
    ASSIGN_OR_RETURN(std::string id, RunId(request->parent()));
    ASSIGN_OR_RETURN(auto folder, runs_.Folder(id));
    ASSIGN_OR_RETURN(auto files, folder->ListFiles());
    ASSIGN_OR_RETURN(
        Page page, PageOf(files.size(), request->page_size(), 1000, 10000, request->page_token()));
    std::map<std::string, std::string> sums;
    for (const ShotRecord& record : folder->Records(0, UINT64_MAX))
      sums.emplace(record.file, record.sha256);
    for (uint64_t i = page.first; i < page.last; ++i) {
      v1::DatasetFile* file = response->add_files();
      file->set_path(files[i].path);
      file->set_bytes(static_cast<int64_t>(files[i].bytes));
      if (auto sum = sums.find(files[i].path); sum != sums.end()) file->set_sha256(sum->second);
    }
    response->set_next_page_token(page.next_token);
    return absl::OkStatus();
  };
  return ToGrpc(listed());
}

grpc::Status RunService::ReadFile(grpc::ServerContext*, const v1::ReadFileRequest* request,
                                  grpc::ServerWriter<v1::ReadFileResponse>* writer) {
  auto read = [&]() -> absl::StatusOr<std::string> {
    ASSIGN_OR_RETURN(std::string id, RunId(request->name()));
    ASSIGN_OR_RETURN(auto folder, runs_.Folder(id));
    ASSIGN_OR_RETURN(std::string path, folder->PathOf(request->path()));
    return folder->env().ReadFile(path);
  };
  auto bytes = read();
  if (!bytes.ok()) return ToGrpc(bytes.status());
  if (request->offset() < 0 || request->offset() > static_cast<int64_t>(bytes->size())) {
    return ToGrpc(Error(absl::StatusCode::kOutOfRange, "OFFSET",
                        absl::StrFormat("offset is %d; %s has %d bytes", request->offset(),
                                        request->path(), bytes->size()),
                        {{"offset", absl::StrCat(request->offset())}, {"path", request->path()}}));
  }
  auto size = static_cast<int64_t>(bytes->size());
  WriteChunks<v1::ReadFileResponse>(
      *writer, std::string_view(*bytes).substr(request->offset()),
      [&](v1::ReadFileResponse& first) { first.set_total_bytes(size); });
  return grpc::Status::OK;
}

}  // namespace lightstage::rpc
