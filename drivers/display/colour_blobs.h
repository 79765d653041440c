// What a graphics card does to codes on their way to the output. Pure.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace lightstage {

// From dark to light: red, green, blue, and what the kernel's drm_color_lut has besides (linux/uapi/drm/drm_mode.h).
using ColourEntry = std::array<uint16_t, 4>;
constexpr uint16_t StraightEntry(size_t i, size_t size) {
  return static_cast<uint16_t>((65535 * i + (size - 1) / 2) / (size - 1));
}

// True if every code of 8 bits comes out as it goes in, to 8 bits: kernels make such tables by shifting, up to 65280, too.
bool IsStraight(std::span<const ColourEntry> table);
// The same of the kernel's DEGAMMA_LUT or GAMMA_LUT.
bool IsStraightBlob(std::span<const std::byte> blob);

// The matrix of the kernel's CTM, drm_color_ctm: true for the identity.
bool IsIdentityBlob(std::span<const std::byte> blob);

}  // namespace lightstage
