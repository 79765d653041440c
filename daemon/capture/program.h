// A program expands a plan into shots, one at a time. It is a generator: the engine asks for the
// next step whenever it has room for one, so that no program ever holds its shots, and 57 344 of
// them cost no more memory than one.
//
// Why a generator with a view of the results, and not a list: an adaptive capture (the next most
// important wavelet) chooses its next shot from the images so far; a hand-held lamp or environment
// matting with and without the object needs a person between two shots; a capture that may be
// stopped at any time has no length. All of these are programs under this contract, and the engine
// need not know. A continuous-motion capture yields its shots in the order of the motion like any
// other.
//
// Rules for a program:
// - Deterministic: its steps follow from its (resolved) plan and from the records of the shots
//   before, never from time, chance or the rig's present state. A run is resumed by making the
//   program anew and asking it again: the engine passes over shots that have a record, and over
//   operator requests that come before one. What a step depends on must therefore be in the plan or
//   in a record.
// - Shots are numbered by the program from 0, in the order in which they are yielded, without gaps.
// - The engine works ahead: when Next() is called, shots yielded before may still be under way. A
//   program that wants to look at them yields AwaitResults first; at the next call every shot
//   yielded so far has a record. Without it, what Results shows depends on timing, and must not be
//   looked at.
// - After Done or an error the program is not asked again. An error ends the run; it carries a
//   reason (base/status.h).
#pragma once

#include <memory>
#include <string>
#include <variant>

#include "absl/status/statusor.h"
#include "daemon/capture/plan.h"
#include "dataset/shot.h"

namespace lightstage {

// The engine waits, with all light off, until the operator says that it is done.
struct OperatorRequest {
  std::string message;  // what the operator shall do, a full sentence
};
struct AwaitResults {};
struct Done {};

using Step = std::variant<Shot, OperatorRequest, AwaitResults, Done>;

// The shots of this run that have a durable record. Implemented by the engine; used only inside
// Next(), on its thread.
class Results {
 public:
  virtual ~Results() = default;
  virtual uint64_t count() const = 0;
  // NOT_FOUND / SHOT_NOT_DONE if the shot has no record yet.
  virtual absl::StatusOr<ShotRecord> Find(uint64_t shot_id) const = 0;
};

// Called from one thread at a time; must not wait.
class Program {
 public:
  virtual ~Program() = default;
  virtual absl::StatusOr<Step> Next(const Results& results) = 0;
};

// For where no results exist: estimates, and programs that do not look at them.
class NoResults final : public Results {
 public:
  uint64_t count() const override { return 0; }
  absl::StatusOr<ShotRecord> Find(uint64_t shot_id) const override;
};

// The program of a plan from ResolvePlan() (daemon/capture/check_plan.h).
std::unique_ptr<Program> MakeProgram(const Plan& resolved);

}  // namespace lightstage
