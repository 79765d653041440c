#include "daemon/store/pipeline.h"

#include <algorithm>

#include "base/failpoint.h"
#include "base/status.h"
#include "dataset/basis_exr.h"
#include "dataset/sha256.h"
#include "spdlog/spdlog.h"

namespace lightstage {
namespace {

// Enough to spread one journal sync over a burst of small images, few enough to tell watchers in time.
constexpr size_t kMostInBatch = 64;

FrameAttributes AttributesOf(const RunHeader& run, const ShotRecord& record) {
  FrameAttributes a;
  a.run_id = run.id;
  a.rig_name = run.rig_name;
  a.shot = record.shot;
  a.reported_pose = record.reported_pose;
  a.direction = record.direction;
  for (const ExposureRecord& e : record.exposures) a.exposures_s.push_back(Seconds(e.used));
  a.captured_at = record.captured_at;
  a.camera = run.geometry.camera;
  return a;
}

}  // namespace

Pipeline::Pipeline(RunFolder& run, DevelopFn develop, const PipelineOptions& options,
                   OutcomeFn outcome)
    : run_(run),
      develop_(std::move(develop)),
      options_(options),
      outcome_(std::move(outcome)),
      raw_(static_cast<size_t>(std::max(options.queue_shots, 1))),
      written_(kMostInBatch) {
  for (int i = 0; i < std::max(options.workers, 1); ++i) workers_.emplace_back([this] { Work(); });
  committer_ = std::thread([this] { Commit(); });
}

Pipeline::~Pipeline() {
  raw_.Close();
  for (std::thread& worker : workers_) worker.join();
  written_.Close();
  committer_.join();
}

void Pipeline::Put(RawShot shot, std::chrono::nanoseconds patience,
                   absl::FunctionRef<void()> stalled) {
  {
    MutexLock lock(&mutex_);
    ++outstanding_;
  }
  if (raw_.PushFor(shot, patience)) return;
  stalled();
  raw_.Push(std::move(shot));
}

void Pipeline::Drain() {
  MutexLock lock(&mutex_);
  while (outstanding_ > 0) drained_.Wait(&mutex_);
}

void Pipeline::Report(uint64_t shot_id, absl::StatusOr<ShotRecord> record) {
  if (!record.ok()) {
    spdlog::error("run {} shot {}: {}", run_.header().id, shot_id,
                  std::string(record.status().message()));
  }
  outcome_({shot_id, std::move(record)});
  MutexLock lock(&mutex_);
  if (--outstanding_ == 0) drained_.SignalAll();
}

void Pipeline::Work() {
  while (std::optional<RawShot> raw = raw_.Pop()) {
    absl::StatusOr<ShotRecord> record = Store(*raw);
    if (record.ok()) {
      written_.Push(*std::move(record));
    } else {
      Report(raw->shot.id, record.status());
    }
  }
}

absl::StatusOr<ShotRecord> Pipeline::Store(const RawShot& raw) {
  const RunHeader& header = run_.header();
  if (run_.HasRecord(raw.shot.id)) {
    return Error(absl::StatusCode::kAlreadyExists, "SHOT_DUPLICATE",
                 absl::StrCat("run ", header.id, ": shot ", raw.shot.id, " has a record already"),
                 {{"run", header.id}, {"shot", absl::StrCat(raw.shot.id)}});
  }
  ASSIGN_OR_RETURN(Developed developed, develop_(raw));
  const Image& pixels = developed.image.pixels;
  if (pixels.width() != header.width || pixels.height() != header.height ||
      pixels.channels() != header.channels) {
    return Error(absl::StatusCode::kFailedPrecondition, "IMAGE_SHAPE",
                 absl::StrCat("shot ", raw.shot.id, " is ", pixels.width(), "x", pixels.height(),
                              "x", pixels.channels(), ", the run's images are ", header.width, "x",
                              header.height, "x", header.channels),
                 {{"shot", absl::StrCat(raw.shot.id)}, {"run", header.id}});
  }
  ShotRecord record;
  record.shot = raw.shot;
  record.reported_pose = raw.reported_pose;
  record.lit_at = raw.lit_at;
  record.direction = developed.direction;
  record.exposures = raw.exposures;
  record.checks = developed.checks;
  record.attempts = raw.attempt;
  record.captured_at = FormatUtc(raw.captured_at);
  record.file = RunFolder::ImageFile(raw.shot.kind, raw.shot.id);
  ASSIGN_OR_RETURN(std::string bytes, EncodeBasisExr(developed.image, AttributesOf(header, record),
                                                     options_.compression));
  record.bytes = bytes.size();
  record.sha256 = Sha256Hex(bytes);
  RETURN_IF_ERROR(run_.env().WriteFile(absl::StrCat(run_.path(), "/", record.file), bytes));
  absl::Status renamed = Failpoint("store.after_rename");
  if (!renamed.ok()) {
    run_.env().Remove(absl::StrCat(run_.path(), "/", record.file)).IgnoreError();
    return renamed;
  }
  return record;
}

void Pipeline::Commit() {
  while (std::optional<ShotRecord> first = written_.Pop()) {
    std::vector<ShotRecord> batch;
    batch.push_back(*std::move(first));
    while (batch.size() < kMostInBatch) {
      std::optional<ShotRecord> more = written_.TryPop();
      if (!more) break;
      batch.push_back(*std::move(more));
    }
    CommitBatch(std::move(batch));
  }
}

void Pipeline::CommitBatch(std::vector<ShotRecord> batch) {
  std::set<std::string> folders;
  for (const ShotRecord& record : batch) folders.insert(ShotKindName(record.shot.kind));
  absl::Status status;
  for (const std::string& folder : folders) {
    if (status.ok()) status = run_.env().SyncDirectory(absl::StrCat(run_.path(), "/", folder));
  }
  if (status.ok()) status = run_.AppendRecords(batch);
  if (status.ok()) status = Failpoint("store.after_journal_sync");
  for (ShotRecord& record : batch) {
    uint64_t id = record.shot.id;
    if (status.ok() || run_.HasRecord(id)) {
      Report(id, std::move(record));
      continue;
    }
    run_.env().Remove(absl::StrCat(run_.path(), "/", record.file)).IgnoreError();
    Report(id, status);
  }
}

}  // namespace lightstage
