// From light to codes: electrons, photon and read noise, full well, response curve, quantisation, pixel formats.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "drivers/api/camera.h"
#include "optics/image.h"
#include "sim/rig/options.h"

namespace lightstage::sim {

// What a frame's significant_bits are on a chip of `bits`.
int SignificantBits(PixelFormat format, int bits);

// Codes of one exposure, as Frame::data wants them. `exposure`: ∫ radiance dt, 3 channels, J/(m²·sr). A grey format sees the mean
// of the channels, a Bayer format one of them per pixel. The noise of a pixel is a function of `noise_key` and its place, its fixed
// pattern of `pattern_key` and its place: equal keys give equal noise. Any thread.
std::vector<std::byte> ReadSensor(const Image& exposure, const SensorOptions& sensor,
                                  PixelFormat format, int bits, double gain_db, uint64_t noise_key,
                                  uint64_t pattern_key);

}  // namespace lightstage::sim
