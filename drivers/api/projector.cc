#include "drivers/api/projector.h"

#include <utility>

namespace lightstage {

void Projector::Check(TimePoint /*deadline*/, Completion<std::monostate> done) {
  std::move(done)(std::monostate());
}

}  // namespace lightstage
