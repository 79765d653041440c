// Light positions (.lp): the plain text that readers of reflectance captures pair with the images.
//
// First line the count, then "filename x y z" per image: the unit direction towards the light with x right, y up and z toward the
// camera in the picture. Readers pair images by sorted order, so names are zero-padded; a widely used one takes at most 1000.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "dataset/shot.h"
#include "optics/rig_geometry.h"

namespace lightstage {

constexpr size_t kMostLightsPerFile = 1000;

struct LightPosition {
  std::string file;
  Vec3 direction;  // camera axes as above, unit
};

// An object-frame direction in the picture's axes.
Vec3 ToCameraAxes(const Vec3& direction, const CameraGeometry& camera);

// "lights_000.lp", "lights_001.lp", …
std::string LightFileName(size_t index);

// The basis images that have a direction, in order, as the texts of LightFileName(0), (1), …; none if there is no such image.
std::vector<std::string> WriteLightPositions(const std::vector<ShotRecord>& shots,
                                             const CameraGeometry& camera);

// DATA_LOSS / LIGHT_POSITIONS_CORRUPT naming `name` and the line.
absl::StatusOr<std::vector<LightPosition>> ParseLightPositions(std::string_view text,
                                                               std::string_view name);

}  // namespace lightstage
