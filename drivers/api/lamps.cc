#include "drivers/api/lamps.h"

#include "absl/strings/str_format.h"

namespace lightstage {

void Lamps::Check(TimePoint /*deadline*/, Completion<std::monostate> done) {
  std::move(done)(std::monostate());
}

absl::Status CheckLevels(const LampsInfo& info, const std::vector<float>& levels) {
  if (static_cast<int>(levels.size()) != info.count) {
    return Error(absl::StatusCode::kInvalidArgument, "LAMP_LEVEL",
                 absl::StrFormat("%s: %d levels given, the brace has %d lamps", info.identity.name,
                                 levels.size(), info.count),
                 {{"device", info.identity.name},
                  {"given", absl::StrCat(levels.size())},
                  {"lamps", absl::StrCat(info.count)}});
  }
  for (size_t i = 0; i < levels.size(); ++i) {
    if (!(levels[i] >= 0.0f && levels[i] <= 1.0f)) {
      return Error(absl::StatusCode::kInvalidArgument, "LAMP_LEVEL",
                   absl::StrFormat("%s: lamp %d: level %g is outside [0, 1]", info.identity.name, i,
                                   levels[i]),
                   {{"device", info.identity.name},
                    {"lamp", absl::StrCat(i)},
                    {"level", absl::StrCat(levels[i])}});
    }
  }
  return absl::OkStatus();
}

}  // namespace lightstage
