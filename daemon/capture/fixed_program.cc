#include "daemon/capture/fixed_program.h"

#include <utility>

namespace lightstage {
namespace {

// True in the gap before basis shot `gap` (after the last one: gap = size).
bool Due(uint64_t gap, uint64_t size, int every) {
  return every > 0 && (gap % static_cast<uint64_t>(every) == 0 || gap == size);
}

class Fixed final : public Program {
 public:
  Fixed(const CommonPlan& common, std::unique_ptr<BasisShots> basis)
      : common_(common), basis_(std::move(basis)) {}

  absl::StatusOr<Step> Next(const Results&) override {
    uint64_t size = basis_->size();
    if (phase_ == Phase::kDark) {
      phase_ = Phase::kReference;
      if (Due(index_, size, common_.dark_every)) return ExtraShot(ShotKind::kDark, Condition());
    }
    if (phase_ == Phase::kReference) {
      phase_ = Phase::kBasis;
      if (Due(index_, size, common_.reference_every)) {
        return ExtraShot(ShotKind::kReference, basis_->Reference());
      }
    }
    if (index_ == size) return Step(Done());
    phase_ = Phase::kDark;
    uint64_t i = index_++;
    return MakeShot(ShotKind::kBasis, basis_->PoseOf(i), basis_->ConditionOf(i));
  }

 private:
  enum class Phase { kDark, kReference, kBasis };  // in one gap, then the basis shot after it

  Step ExtraShot(ShotKind kind, Condition condition) {
    return MakeShot(kind, basis_->PoseOf(index_ == 0 ? 0 : index_ - 1), std::move(condition));
  }

  Step MakeShot(ShotKind kind, const Pose& pose, Condition condition) {
    return Shot{next_id_++, kind, pose, std::move(condition), common_.exposures};
  }

  const CommonPlan common_;
  const std::unique_ptr<BasisShots> basis_;
  Phase phase_ = Phase::kDark;
  uint64_t index_ = 0;  // of the next basis shot
  uint64_t next_id_ = 0;
};

}  // namespace

std::unique_ptr<Program> FixedProgram(const CommonPlan& common, std::unique_ptr<BasisShots> basis) {
  return std::make_unique<Fixed>(common, std::move(basis));
}

uint64_t ExtraShotCount(uint64_t basis_shots, int every) {
  if (every <= 0) return 0;
  uint64_t n = static_cast<uint64_t>(every);
  return 1 + (basis_shots + n - 1) / n;
}

}  // namespace lightstage
