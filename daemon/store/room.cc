#include "daemon/store/room.h"

#include "absl/strings/str_format.h"
#include "base/status.h"

namespace lightstage {
namespace {

std::string Readable(uint64_t bytes) {
  return bytes < 1'000'000'000 ? absl::StrFormat("%.1f MB", static_cast<double>(bytes) / 1e6)
                               : absl::StrFormat("%.1f GB", static_cast<double>(bytes) / 1e9);
}

}  // namespace

absl::Status CheckRoom(Env& env, const std::string& path, uint64_t bytes) {
  ASSIGN_OR_RETURN(uint64_t free, env.FreeBytes(path));
  uint64_t needed = bytes + kReserveBytes;
  if (free >= needed) return absl::OkStatus();
  return Error(
      absl::StatusCode::kResourceExhausted, "DISK_TOO_SMALL",
      absl::StrCat("the run needs ", Readable(needed), ", of which ", Readable(kReserveBytes),
                   " stay free, on the disk of ", path, ", which has ", Readable(free), " free"),
      {{"path", path}, {"needed_bytes", absl::StrCat(needed)}, {"free_bytes", absl::StrCat(free)}});
}

}  // namespace lightstage
