#include "sim/render/slabs.h"

#include <sys/mman.h>

#include <algorithm>
#include <new>
#include <utility>

namespace lightstage::sim {
namespace {

constexpr size_t kHugePage = size_t{2} << 20;
constexpr size_t kSlab = size_t{32} << 20;

size_t RoundUp(size_t n, size_t to) { return (n + to - 1) / to * to; }

}  // namespace

float* Slabs::Take(size_t count) {
  const size_t bytes = RoundUp(count * sizeof(float), kAlignment);
  MutexLock lock(&mutex_);
  if (bytes > left_) {
    const size_t size = RoundUp(std::max(bytes, kSlab), kHugePage);
    void* const slab = std::aligned_alloc(kHugePage, size);
    if (slab == nullptr) throw std::bad_alloc();
    ::madvise(slab, size, MADV_HUGEPAGE);  // without huge pages it only takes longer
    slabs_.emplace_back(slab);
    next_ = static_cast<char*>(slab);
    left_ = size;
  }
  left_ -= bytes;
  return reinterpret_cast<float*>(std::exchange(next_, next_ + bytes));
}

}  // namespace lightstage::sim
