// From raw shots to durable records: the sink behind the engine.
//
// Workers develop, encode and write whole images, each on its own; one committer makes batches of them durable together: one
// directory sync and one journal sync for as many shots as are ready. A shot's outcome comes after that, never before.
#pragma once

#include <functional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "base/mutex.h"
#include "base/queue.h"
#include "daemon/develop/develop.h"
#include "daemon/engine/shot_sink.h"
#include "daemon/store/run_folder.h"
#include "dataset/exr.h"

namespace lightstage {

struct PipelineOptions {
  int workers = 1;
  int queue_shots = 1;  // raw shots that may wait for a worker
  ExrCompression compression = ExrCompression::kPiz;
};

class Pipeline final : public ShotSink {
 public:
  using DevelopFn = std::function<absl::StatusOr<Developed>(const RawShot&)>;

  // `run` must be appending and outlive the pipeline. `develop` and `outcome` are called from its threads; `outcome` must not
  // call Drain() or Put().
  Pipeline(RunFolder& run, DevelopFn develop, const PipelineOptions& options, OutcomeFn outcome);
  // Finishes what was put.
  ~Pipeline() override;

  // A failed shot leaves no file behind, and may be put again. ALREADY_EXISTS / SHOT_DUPLICATE if it has a record.
  void Put(RawShot shot, std::chrono::nanoseconds patience,
           absl::FunctionRef<void()> stalled) override;
  void Drain() override;

 private:
  void Work();
  void Commit();
  void CommitBatch(std::vector<ShotRecord> batch);
  absl::StatusOr<ShotRecord> Store(const RawShot& raw);
  void Report(uint64_t shot_id, absl::StatusOr<ShotRecord> record);

  RunFolder& run_;
  const DevelopFn develop_;
  const PipelineOptions options_;
  const OutcomeFn outcome_;
  BoundedQueue<RawShot> raw_;
  BoundedQueue<ShotRecord> written_;  // files in place, not durable yet
  Mutex mutex_;
  CondVar drained_;
  uint64_t outstanding_ ABSL_GUARDED_BY(mutex_) = 0;
  std::vector<std::thread> workers_;
  std::thread committer_;
};

}  // namespace lightstage
