// Is there room on the disk for what is to be captured?
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "base/env.h"

namespace lightstage {

// RESOURCE_EXHAUSTED / DISK_TOO_SMALL naming both figures unless the filesystem that holds `path` has `bytes` free, and some more
// for the journal's last lines and everybody else on the machine.
absl::Status CheckRoom(Env& env, const std::string& path, uint64_t bytes);

}  // namespace lightstage
