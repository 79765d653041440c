// Relighting a captured object with an environment map: E = Σ_i w_i Img_i (dissertation eq. 3.3; scale and cells: relight/cells.h).
#pragma once

#include "absl/status/statusor.h"
#include "optics/environment_map.h"
#include "optics/image.h"
#include "relight/cells.h"
#include "relight/dataset_reader.h"

namespace lightstage::relight {

struct Relit {
  Image image;             // 3 channels, or 1 if images and map are grey
  int images_used = 0;     // of the weighted sum
  int images_skipped = 0;  // basis images without a direction
  // Pixels into which a sample beyond the camera's range went: they are too dark.
  double above_range_share = 0;
  Cells cells;  // by basis image that has a direction, in order
};

// The map's azimuth 0° is the object frame's +X, its zenith the rig's; `rotate` turns it about the vertical, counterclockwise from
// above. A basis image taken with lamps at a sum of levels other than 1 is scaled to 1, so that every image answers to the same
// irradiance; images of one direction (patterns of one projector position) share its weight equally.
// Dark frames are not subtracted: one frame's noise would count 2π-fold.
// Reads every image once, one per hardware thread at a time: memory is a few pictures, whatever the number of images.
// FAILED_PRECONDITION / LIT_BY_PATTERNS if a projector lit the object, NO_LIGHT_DIRECTIONS if no basis image has a direction; errors of reading.
absl::StatusOr<Relit> RelightWithEnvironment(const Dataset& dataset, const EnvironmentMap& map,
                                             Angle rotate);

}  // namespace lightstage::relight
