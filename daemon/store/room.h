// Is there room on the disk for what is to be captured?
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "base/env.h"

namespace lightstage {

// Kept free for the journal's last lines and everybody else on the machine.
inline constexpr uint64_t kReserveBytes = uint64_t{64} << 20;

// RESOURCE_EXHAUSTED / DISK_TOO_SMALL naming both figures unless the filesystem that holds `path` has `bytes` and the
// reserve free.
absl::Status CheckRoom(Env& env, const std::string& path, uint64_t bytes);

}  // namespace lightstage
