#pragma once

namespace lightstage {

// For programs that make and free megabytes of frames and images for every shot; call once at start. By default the allocator gives
// each large block back to the kernel, and having the next one's pages cleared costs about a tenth of encoding it (measured by
// bench/store_bench at 1920×1200).
void KeepFrameMemory();

}  // namespace lightstage
