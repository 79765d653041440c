// Environment maps, and incident light fields from a folder.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "optics/environment_map.h"
#include "sim/render/environment_light.h"

namespace lightstage::sim {

// INVALID_ARGUMENT / ENVIRONMENT_INVALID naming the file and its pixel, if it shines brighter than can be computed with.
absl::StatusOr<EnvironmentMap> ReadEnvironmentMap(const std::string& file);

// DIR/light_field.toml says where the grid stands, in the object frame, and DIR/ROW-COLUMN.exr are its environment maps:
//   columns = 5                  # 1 to 64
//   rows = 4
//   origin_m = [-0.2, -0.2, 0.1] # where 0-0.exr was taken
//   u_m = [0.4, 0, 0]            # from there to the last column
//   v_m = [0, 0.4, 0]            # … and to the last row
// Each file's own errors; INVALID_ARGUMENT if the maps are not of one size or all black.
absl::StatusOr<IncidentLightField> ReadLightField(const std::string& directory);

}  // namespace lightstage::sim
