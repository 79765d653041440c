// A loop over the hardware's threads.
#pragma once

#include <algorithm>
#include <thread>
#include <vector>

namespace lightstage::relight {

inline int ThreadsFor(size_t items) {
  const size_t hardware = std::max(1u, std::thread::hardware_concurrency());
  return static_cast<int>(std::clamp<size_t>(items, 1, hardware));
}

// Calls work(t) for t in [0, threads), each on a thread of its own, and waits for all.
template <class Work>
void RunOnThreads(int threads, Work work) {
  std::vector<std::thread> others;
  for (int t = 1; t < threads; ++t) others.emplace_back([&work, t] { work(t); });
  work(0);
  for (std::thread& thread : others) thread.join();
}

}  // namespace lightstage::relight
