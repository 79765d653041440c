// The spherical Voronoi cells of a set of light directions, and an environment map integrated over them: the weights of
//   E = Σ_i w_i Img_i,   w_i = ∫ over cell i of the map's radiance dω      (dissertation eq. 3.3).
//
// Scale: w_i is the irradiance that cell i's light makes on a surface facing it (radiance × sr). Img_i answers to a lamp that makes some
// irradiance at the object, the same for all lamps of a rig; E is therefore the camera's signal under the map, up to that one
// constant: (camera units per second) × (map irradiance) / (lamp irradiance). Under a map of radiance 1 the weights are the
// cells' solid angles.
//
// What is lit: if no direction lies more than 0.1° below the horizon, the capture knows nothing about light from below. Then only the map's upper
// hemisphere is divided into cells, and the rest is left out and accounted for; it is never given to lamps at the horizon.
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "base/units.h"
#include "optics/direction.h"
#include "optics/environment_map.h"

namespace lightstage::relight {

struct Cells {
  std::vector<Radiance> weights;         // by direction: map integrated over its cell
  std::vector<double> solid_angles;      // by direction, sr; their sum is 2π or 4π
  Radiance covered = Radiance::Zero();   // Σ weights
  Radiance left_out = Radiance::Zero();  // map integrated over what is not divided into cells
  bool upper_hemisphere_only = false;
  // The largest angle between a covered direction and the light that stands for it.
  Angle farthest;
};

// Integrates `map`, turned by `rotate` about +Z (counterclockwise from above), over the cells of `directions` (object frame, unit).
// Directions that coincide (within 1e−6 rad) share their cell equally. Texels are split where cells meet, also where a cell is narrower
// than a texel; what is left at the leaves is split along the bisector, so the error of a cell's area is below 0.1 %.
// INVALID_ARGUMENT / NO_LIGHT_DIRECTIONS if there is no direction. Uses the hardware's threads; the result does not depend on them
// beyond rounding.
absl::StatusOr<Cells> IntegrateOverCells(const EnvironmentMap& map,
                                         const std::vector<Vec3>& directions, Angle rotate);

}  // namespace lightstage::relight
