#include "dataset/shot.h"

#include "base/status.h"

namespace lightstage {

const char* ShotKindName(ShotKind kind) {
  switch (kind) {
    case ShotKind::kBasis:
      return "basis";
    case ShotKind::kDark:
      return "dark";
    case ShotKind::kReference:
      return "reference";
  }
  return "?";
}

absl::StatusOr<ShotKind> ParseShotKind(std::string_view name) {
  for (ShotKind kind : {ShotKind::kBasis, ShotKind::kDark, ShotKind::kReference}) {
    if (name == ShotKindName(kind)) return kind;
  }
  return Error(absl::StatusCode::kInvalidArgument, "SHOT_KIND",
               absl::StrCat("shot kind '", name, "'; must be basis, dark or reference"),
               {{"kind", std::string(name)}});
}

std::string DescribeShot(const Shot& shot) {
  constexpr size_t kMostLampsNamed = 3;
  std::string lights;
  const auto& lamps = shot.condition.lamps;
  if (lamps.size() > kMostLampsNamed) {
    lights = absl::StrCat(lamps.size(), " lamps");
  } else {
    for (const LampLevel& lamp : lamps) {
      absl::StrAppend(&lights, lights.empty() ? "" : ", ", "lamp ", lamp.lamp, " at ", lamp.level);
    }
  }
  if (shot.condition.pattern) {
    absl::StrAppend(&lights, lights.empty() ? "" : ", ", "pattern ",
                    PatternName(*shot.condition.pattern));
  }
  return absl::StrCat("shot ", shot.id, " (", ShotKindName(shot.kind),
                      "): ", lights.empty() ? "dark" : lights, ", azimuth ",
                      shot.pose.azimuth.degrees(), ", tilt ", shot.pose.tilt.degrees());
}

}  // namespace lightstage
