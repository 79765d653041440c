// What exr.cc and basis_exr.cc share: OpenEXR in memory, with its exceptions turned into statuses. Not for other rooms.
#pragma once

#include <ImathBox.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <ImfPixelType.h>
#include <half.h>

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/statusor.h"
#include "dataset/exr.h"

namespace lightstage::exr_codec {

Imf::Compression ToImf(ExrCompression compression);

// The channel names of a picture: {"Y"} or {"R", "G", "B"}.
std::vector<std::string> ChannelNames(int channels);

// A header for `width`×`height` pixels with one channel of `type` per name.
Imf::Header MakeHeader(int width, int height, const std::vector<std::string>& channels,
                       Imf::PixelType type, ExrCompression compression);

constexpr float kLargestHalf = 65504.0f;

// Rounds to half and clamps to ±kLargestHalf.
enum class HalfResult { kExact, kClamped, kNotFinite };
HalfResult ToHalf(const float* from, size_t count, uint16_t* to);

// One channel's samples in memory, `x_stride` and `y_stride` in bytes.
struct Plane {
  std::string name;
  Imf::PixelType type;
  const void* data;
  size_t x_stride, y_stride;
};

// The whole file as bytes.
absl::StatusOr<std::string> Write(const Imf::Header& header, const std::vector<Plane>& planes);

// Opens `bytes`, checks its size and hands it to `read`, whose exceptions become DATA_LOSS too.
absl::Status Read(std::string_view bytes, std::string_view name,
                  absl::FunctionRef<absl::Status(Imf::InputFile&)> read);

// The R, G, B or Y pixels of an open file.
absl::StatusOr<Image> ReadPixels(Imf::InputFile& file, std::string_view name);

absl::Status Corrupt(std::string_view name, std::string_view why);
absl::Status Unsupported(std::string_view name, std::string_view why);

}  // namespace lightstage::exr_codec
