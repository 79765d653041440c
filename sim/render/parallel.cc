#include "sim/render/parallel.h"

#include <algorithm>
#include <atomic>
#include <climits>
#include <exception>
#include <list>
#include <new>
#include <system_error>
#include <thread>

#include "absl/base/thread_annotations.h"
#include "base/mutex.h"

namespace lightstage::sim {
namespace {

class Pool {
 public:
  // Lives as long as the process.
  static Pool& Get() {
    static Pool& pool = *new Pool;
    return pool;
  }

  void Run(int count, absl::FunctionRef<void(int)> body) {
    Job job{count, body};
    {
      MutexLock lock(&mutex_);
      jobs_.push_back(&job);
      wake_.SignalAll();
    }
    Work(job);
    MutexLock lock(&mutex_);
    jobs_.remove(&job);
    while (job.helpers > 0) done_.Wait(&mutex_);
    if (job.thrown != nullptr) std::rethrow_exception(job.thrown);
  }

  void SetLimit(int threads) {
    MutexLock lock(&mutex_);
    limit_ = threads;
    wake_.SignalAll();
  }

 private:
  struct Job {
    int count;
    absl::FunctionRef<void(int)> body;
    std::atomic<int> next{0};
    int helpers = 0;            // under mutex_
    std::exception_ptr thrown;  // under mutex_
  };

  // With as many helpers as there may be: whoever calls Run works too.
  Pool() {
    const int cores = static_cast<int>(std::thread::hardware_concurrency());
    try {
      for (int i = 1; i < std::max(cores, 2); ++i) std::thread([this, i] { Help(i); }).detach();
    } catch (const std::system_error&) {
    } catch (const std::bad_alloc&) {
    }
  }

  void Work(Job& job) {
    try {
      for (int i; (i = job.next.fetch_add(1, std::memory_order_relaxed)) < job.count;) job.body(i);
    } catch (...) {
      job.next = job.count;  // none are left to begin
      MutexLock lock(&mutex_);
      if (job.thrown == nullptr) job.thrown = std::current_exception();
    }
  }

  void Help(int index) {
    MutexLock lock(&mutex_);
    while (true) {
      if (jobs_.empty() || index >= limit_) {
        wake_.Wait(&mutex_);
        continue;
      }
      Job& job = *jobs_.front();
      ++job.helpers;
      mutex_.Unlock();
      Work(job);
      mutex_.Lock();
      // None are left to begin.
      jobs_.remove(&job);
      if (--job.helpers == 0) done_.SignalAll();
    }
  }

  Mutex mutex_;
  CondVar wake_, done_;
  std::list<Job*> jobs_ ABSL_GUARDED_BY(mutex_);
  int limit_ ABSL_GUARDED_BY(mutex_) = INT_MAX;
};

}  // namespace

void ForAll(int count, absl::FunctionRef<void(int)> body) { Pool::Get().Run(count, body); }

ThreadLimit::ThreadLimit(int threads) { Pool::Get().SetLimit(threads); }
ThreadLimit::~ThreadLimit() { Pool::Get().SetLimit(INT_MAX); }

}  // namespace lightstage::sim
