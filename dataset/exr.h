// OpenEXR pictures in general: environment maps, relit pictures, snaps. For basis images see basis_exr.h.
//
// Nothing here throws or crashes on bad input. Reading: DATA_LOSS / EXR_CORRUPT names the file and what is wrong with it;
// INVALID_ARGUMENT / EXR_UNSUPPORTED if the file is right but not of the kind that is read here. All functions are thread-safe.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "base/env.h"
#include "optics/image.h"

namespace lightstage {

enum class ExrCompression { kNone, kRle, kZips, kZip, kPiz, kDwaa };

// "none", "rle", "zips", "zip", "piz", "dwaa" (lossy), in the order of the enum: what a rig file may say.
const std::vector<std::string>& ExrCompressionNames();
const std::string& ExrCompressionName(ExrCompression compression);
absl::StatusOr<ExrCompression> ParseExrCompression(std::string_view name);

enum class ExrPixelType { kHalf, kFloat };

// Larger pictures are refused, so that a damaged header cannot ask for all memory.
constexpr int kMaxExrSide = 32768;
constexpr uint64_t kMaxExrSamples = uint64_t{1} << 28;  // width · height · channels

// A picture with channels R, G, B or with Y: 3 or 1 channels; others are ignored. Any compression and pixel type. The data window
// must be the display window: a cropped environment map would be mapped wrongly. `name` stands in messages. DATA_LOSS / EXR_CORRUPT, or RESOURCE_EXHAUSTED / MEMORY if there is not enough.
absl::StatusOr<Image> DecodeExr(std::string_view bytes, std::string_view name);
// RESOURCE_EXHAUSTED / FILE_TOO_LARGE if the file has more than kLargestInput (base/env.h).
absl::StatusOr<Image> ReadExr(const std::string& path, Env& env = PosixEnv());

// Image of 1 (Y) or 3 (R, G, B) channels. Half clamps to ±65504. INVALID_ARGUMENT / IMAGE_INVALID for NaN, infinity or other shapes.
absl::StatusOr<std::string> EncodeExr(const Image& image, ExrPixelType type,
                                      ExrCompression compression = ExrCompression::kPiz);
absl::Status WriteExr(const std::string& path, const Image& image, ExrPixelType type,
                      ExrCompression compression = ExrCompression::kPiz, Env& env = PosixEnv());

}  // namespace lightstage
