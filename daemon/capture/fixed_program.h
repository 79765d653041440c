// The program of a plan whose basis shots are all known beforehand: it puts the dark and reference
// frames between them (CommonPlan says where) and numbers the lot.
#pragma once

#include <memory>

#include "daemon/capture/program.h"

namespace lightstage {

// The basis shots of a plan by index; every call is O(1) and depends on nothing but the index.
class BasisShots {
 public:
  virtual ~BasisShots() = default;
  virtual uint64_t size() const = 0;  // at least 1
  virtual Pose PoseOf(uint64_t index) const = 0;
  virtual Condition ConditionOf(uint64_t index) const = 0;
  virtual Condition Reference() const = 0;  // full on
};

std::unique_ptr<Program> FixedProgram(const CommonPlan& common, std::unique_ptr<BasisShots> basis);

// Of one kind, with a frame every `every` basis shots.
uint64_t ExtraShotCount(uint64_t basis_shots, int every);

}  // namespace lightstage
