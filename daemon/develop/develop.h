// From raw frames to a basis image: unpack, black level, response, HDR merge, demosaic, checks.
#pragma once

#include <optional>

#include "absl/status/statusor.h"
#include "daemon/config/rig_file.h"
#include "daemon/engine/shot_sink.h"
#include "dataset/basis_image.h"
#include "dataset/shot.h"
#include "optics/rig_geometry.h"

namespace lightstage {

struct Developed {
  BasisImage image;
  ShotChecks checks;
  std::optional<Vec3> direction;  // object frame, unit, towards the light
};

// Develops one shot. Pure: the result depends on the arguments only; any number of threads may call it.
//
// Pixels are in the unit of optics/hdr.h: with a linear camera, share of full scale per second of the exposure that the camera really
// used. `options.black_level` is a raw code; a sample is black up to `noise_floor` and saturated from `saturation`, shares of full
// scale, the former above the black level. Mono formats give one channel, RGB and Bayer ones three, at full resolution.
//
// Errors (all name the shot): INVALID_ARGUMENT / SHOT_INVALID if frames are missing, differ from each other in format, size, depth or
// gain, or hold another number of bytes than their size says; if the exposures or code range cannot be merged
// (BRACKET_INVALID), or the shot names a lamp that the brace does not have.
absl::StatusOr<Developed> Develop(const RawShot& raw, const DevelopOptions& options,
                                  const RigGeometry& geometry);

// Where a condition's light comes from, in the object frame with the rig at `pose`: the lamp; several lamps: the mean of their directions
// weighted by level; a pattern: the projector. Absent without light, with lamps and projector at once, and where the mean of the
// lamps has no direction. Every lamp must be on the brace.
std::optional<Vec3> LightDirection(const Condition& condition, const Pose& pose,
                                   const RigGeometry& geometry);

}  // namespace lightstage
