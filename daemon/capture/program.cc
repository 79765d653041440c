#include "daemon/capture/program.h"

#include "absl/strings/str_cat.h"
#include "base/status.h"
#include "daemon/capture/light_stage.h"
#include "daemon/capture/projector_4d.h"

namespace lightstage {

absl::StatusOr<ShotRecord> NoResults::Find(uint64_t shot_id) const {
  return Error(absl::StatusCode::kNotFound, "SHOT_NOT_DONE",
               absl::StrCat("shot ", shot_id, " has no record yet"),
               {{"shot", absl::StrCat(shot_id)}});
}

std::unique_ptr<Program> MakeProgram(const Plan& resolved) {
  if (const auto* light_stage = std::get_if<LightStagePlan>(&resolved.kind)) {
    return LightStageProgram(resolved.common, *light_stage);
  }
  return Projector4dProgram(resolved.common, std::get<Projector4dPlan>(resolved.kind));
}

}  // namespace lightstage
