#include "base/memory.h"

#include <malloc.h>

namespace lightstage {

void KeepFrameMemory() {
  mallopt(M_MMAP_THRESHOLD, 32 << 20);  // the most that glibc takes
  mallopt(M_TRIM_THRESHOLD, 512 << 20);
}

}  // namespace lightstage
