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

// Slabs of the usual size that nobody needs now: the next picture's paths need as many, and the kernel would clear every page again.
class Pool {
 public:
  // Lives as long as the process.
  static Pool& Get() {
    static Pool& pool = *new Pool;
    return pool;
  }
  // Null if there is none.
  void* Take() {
    MutexLock lock(&mutex_);
    if (free_.empty()) return nullptr;
    void* const slab = free_.back();
    free_.pop_back();
    return slab;
  }
  bool Keep(void* slab) {
    MutexLock lock(&mutex_);
    if (free_.size() >= kMost) return false;
    free_.push_back(slab);
    return true;
  }

 private:
  static constexpr size_t kMost = Slabs::kMostKept / kSlab;
  Mutex mutex_;
  std::vector<void*> free_ ABSL_GUARDED_BY(mutex_);
};

void* NewSlab(size_t size) {
  void* const slab = std::aligned_alloc(kHugePage, size);
  if (slab == nullptr) throw std::bad_alloc();
  ::madvise(slab, size, MADV_HUGEPAGE);  // without huge pages it only takes longer
  return slab;
}

}  // namespace

void Slabs::Free::operator()(void* slab) const {
  if (!usual || !Pool::Get().Keep(slab)) std::free(slab);
}

char* Slabs::Stretch::Cut(size_t bytes) {
  left -= bytes;
  return std::exchange(next, next + bytes);
}

float* Slabs::Take(size_t count) {
  const size_t bytes = RoundUp(count * sizeof(float), kAlignment);
  MutexLock lock(&mutex_);
  Stretch& page = pages_[std::this_thread::get_id()];
  if (bytes > page.left) {
    const size_t pages = RoundUp(bytes, kHugePage);
    if (pages > rest_.left) {
      const size_t size = std::max(pages, kSlab);
      void* slab = size == kSlab ? Pool::Get().Take() : nullptr;
      if (slab == nullptr) slab = NewSlab(size);
      slabs_.emplace_back(slab, Free{size == kSlab});
      rest_ = {static_cast<char*>(slab), size};
    }
    page = {rest_.Cut(pages), pages};
  }
  return reinterpret_cast<float*>(page.Cut(bytes));
}

}  // namespace lightstage::sim
