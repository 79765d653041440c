// Much memory in pieces that are given back together. It lies in huge pages where the kernel has them: taking it page by page costs as
// much as tracing what is put there. Every thread fills pages of its own: of two that touch a new one together each would wait for the
// kernel to clear it.
#pragma once

#include <cstddef>
#include <cstdlib>
#include <map>
#include <memory>
#include <thread>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "base/mutex.h"

namespace lightstage::sim {

class Slabs {
 public:
  static constexpr size_t kAlignment = 64;  // bytes, a cache line
  // What the process keeps of memory that was given back, for the next to take.
  static constexpr size_t kMostKept = size_t{256} << 20;

  // `count` floats, not set to anything. Thread-safe. std::bad_alloc if there is no memory.
  float* Take(size_t count);

 private:
  struct Free {
    bool usual = false;  // of the size that is kept for others
    void operator()(void* slab) const;
  };
  struct Stretch {
    char* next = nullptr;
    size_t left = 0;  // bytes from there on
    char* Cut(size_t bytes);
  };
  Mutex mutex_;
  std::vector<std::unique_ptr<void, Free>> slabs_ ABSL_GUARDED_BY(mutex_);
  Stretch rest_ ABSL_GUARDED_BY(mutex_);  // of the last slab
  std::map<std::thread::id, Stretch> pages_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace lightstage::sim
