// Whether a frame shows any of a light that is switched: learned from frames of which that is known. Pure.
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "drivers/api/camera.h"

namespace lightstage {

// Mean code of each row. Rows, because those of a rolling shutter see the light at times of their own.
using RowMeans = std::vector<double>;
RowMeans RowMeansOf(const Frame& frame);

class LightSeen {
 public:
  // From frames in the dark and in the light, at least two of each, all of one size. FAILED_PRECONDITION / LIGHT_NOT_SEEN if the light makes
  // no clear and steady difference to the first and the last row: one of them is the first to be exposed.
  static absl::StatusOr<LightSeen> Learn(const std::vector<RowMeans>& dark,
                                         const std::vector<RowMeans>& lit);

  // More light in any row than there is in the dark.
  bool Any(const RowMeans& rows) const;
  // The first and the last row have the light, but for a fifth at most.
  bool Whole(const RowMeans& rows) const;
  // The share of an exposure in which light that was whole may have been on without being seen.
  double unseen() const { return unseen_; }

 private:
  RowMeans threshold_;  // infinite in rows that the light does not reach
  double first_whole_ = 0, last_whole_ = 0;
  double unseen_ = 0;
};

}  // namespace lightstage
