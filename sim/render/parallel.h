// Loops on all cores.
//
// Threads of our own and not TBB, which Embree brings along: Debian's is not built with ThreadSanitizer, which then takes every one
// of its loops for a race, and a loop over pixels needs no more than this.
#pragma once

#include "absl/functional/function_ref.h"

namespace lightstage::sim {

// Calls body(i) once for every i in [0, count), on this thread and on those of a pool that the process shares, and returns when all
// are done. Which thread does which must not matter. May be called from any number of threads, and from a body. What a body throws,
// the first if there are several, is thrown here; some calls are then not made.
void ForAll(int count, absl::FunctionRef<void(int)> body);

// While one lives, the pool's other threads take no new work if `threads` is 1, and all but so many − 1 of them otherwise. For
// tests; one at a time.
class ThreadLimit {
 public:
  explicit ThreadLimit(int threads);
  ~ThreadLimit();
  ThreadLimit(const ThreadLimit&) = delete;
  ThreadLimit& operator=(const ThreadLimit&) = delete;
};

}  // namespace lightstage::sim
