// A basis image as one OpenEXR file (docs/DATASET.md, "Basis images").
//
// Pixels are half R,G,B or Y. If any pixel is flagged there is a third kind of channel, "flags", half too: 0, 1, 2 or 3 are exact.
// Thread-safe; errors as in exr.h.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "dataset/basis_image.h"
#include "dataset/exr.h"
#include "dataset/shot.h"
#include "optics/rig_geometry.h"

namespace lightstage {

// What a basis image says about itself, so that it can be understood without its manifest.
struct FrameAttributes {
  std::string run_id;
  std::string rig_name;
  Shot shot;  // of the bracket, `exposures` is not kept (see exposures_s)
  Pose reported_pose;
  std::optional<Vec3> direction;         // object frame
  std::vector<double> exposures_s;       // as used, ascending; single precision in the file
  std::string captured_at;               // RFC 3339, UTC
  std::optional<CameraGeometry> camera;  // becomes worldToCamera; not read back
};

struct DecodedBasis {
  BasisImage image;
  FrameAttributes attributes;
};

// Values beyond what a half holds are written as its largest and flagged kAboveRange. INVALID_ARGUMENT / IMAGE_INVALID if the image
// is empty, has other than 1 or 3 channels, a wrong number of flags, or a value that is not finite.
absl::StatusOr<std::string> EncodeBasisExr(const BasisImage& image,
                                           const FrameAttributes& attributes,
                                           ExrCompression compression);

absl::StatusOr<DecodedBasis> DecodeBasisExr(std::string_view bytes, std::string_view name);
absl::StatusOr<DecodedBasis> ReadBasisExr(const std::string& path, Env& env = PosixEnv());

// All but the pixels, from the header alone.
struct BasisHeader {
  int width = 0, height = 0, channels = 0;
  FrameAttributes attributes;
};
absl::StatusOr<BasisHeader> ReadBasisHeader(std::string_view bytes, std::string_view name);

}  // namespace lightstage
