#include "base/failpoint.h"

#include <signal.h>
#include <unistd.h>

#include <atomic>
#include <cstdint>
#include <cstdlib>
#include <map>
#include <string>

#include "absl/base/thread_annotations.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_split.h"
#include "base/mutex.h"
#include "base/status.h"

namespace lightstage {
namespace {

struct Point {
  bool kill = false;
  uint64_t due = 0;  // the hit at which it acts
  uint64_t hits = 0;
};

struct Points {
  std::atomic<bool> any{false};
  Mutex mutex;
  std::map<std::string, Point, std::less<>> by_name ABSL_GUARDED_BY(mutex);
};

Points& All() {
  static Points& points = *new Points;
  return points;
}

}  // namespace

absl::Status Failpoint(std::string_view name) {
  Points& points = All();
  if (!points.any.load(std::memory_order_relaxed)) return absl::OkStatus();
  MutexLock lock(&points.mutex);
  auto it = points.by_name.find(name);
  if (it == points.by_name.end() || ++it->second.hits != it->second.due) return absl::OkStatus();
  if (it->second.kill) ::kill(::getpid(), SIGKILL);
  return Error(absl::StatusCode::kInternal, "FAILPOINT",
               absl::StrCat("failpoint ", name, " at hit ", it->second.due),
               {{"failpoint", std::string(name)}, {"hit", absl::StrCat(it->second.due)}});
}

absl::Status SetFailpoints(std::string_view spec) {
  std::map<std::string, Point, std::less<>> parsed;
  absl::Status status;
  for (absl::string_view entry : absl::StrSplit(AbslView(spec), ';', absl::SkipWhitespace())) {
    std::pair<absl::string_view, absl::string_view> name_action =
        absl::StrSplit(entry, absl::MaxSplits('=', 1));
    std::pair<absl::string_view, absl::string_view> action_count =
        absl::StrSplit(name_action.second, absl::MaxSplits(':', 1));
    Point point;
    point.kill = action_count.first == "kill";
    if (name_action.first.empty() || (!point.kill && action_count.first != "error") ||
        !absl::SimpleAtoi(action_count.second, &point.due) || point.due == 0) {
      status =
          Error(absl::StatusCode::kInvalidArgument, "FAILPOINT_SPEC",
                absl::StrCat("failpoint '", entry, "': want NAME=kill:N or NAME=error:N, N from 1"),
                {{"entry", std::string(entry)}});
      parsed.clear();
      break;
    }
    parsed.emplace(std::string(name_action.first), point);
  }
  Points& points = All();
  MutexLock lock(&points.mutex);
  points.by_name = std::move(parsed);
  points.any.store(!points.by_name.empty(), std::memory_order_relaxed);
  return status;
}

absl::Status SetFailpointsFromEnvironment() {
  const char* spec = std::getenv("LIGHTSTAGED_FAILPOINTS");
  return SetFailpoints(spec == nullptr ? "" : spec);
}

}  // namespace lightstage
