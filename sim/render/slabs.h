// Much memory in pieces that are given back together. It lies in huge pages where the kernel has them: taking it page by page costs as
// much as tracing what is put there.
#pragma once

#include <cstddef>
#include <cstdlib>
#include <memory>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "base/mutex.h"

namespace lightstage::sim {

class Slabs {
 public:
  static constexpr size_t kAlignment = 64;  // bytes, a cache line

  // `count` floats, not set to anything. Thread-safe. std::bad_alloc if there is no memory.
  float* Take(size_t count);

 private:
  struct Free {
    void operator()(void* p) const { std::free(p); }
  };
  Mutex mutex_;
  std::vector<std::unique_ptr<void, Free>> slabs_ ABSL_GUARDED_BY(mutex_);
  char* next_ ABSL_GUARDED_BY(mutex_) = nullptr;
  size_t left_ ABSL_GUARDED_BY(mutex_) = 0;  // bytes from next_ on
};

}  // namespace lightstage::sim
