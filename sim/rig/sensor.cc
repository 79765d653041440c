#include "sim/rig/sensor.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "sim/render/hash.h"
#include "sim/render/parallel.h"

namespace lightstage::sim {
namespace {

constexpr int kNormals = 1 << 16;

// The inverse of the normal distribution's function at the middles of 65536 equal shares: a normal number for 16 random bits, up to
// 4.3 σ.
const std::vector<float>& NormalQuantiles() {
  static const auto* const kTable = [] {
    auto* table = new std::vector<float>(kNormals);
    for (int i = 0; i < kNormals / 2; ++i) {
      const double p = (i + 0.5) / kNormals;
      // A first guess (Abramowitz & Stegun 26.2.23) and Newton steps on the exact function.
      const double t = std::sqrt(-2 * std::log(p));
      double x = -(t - (2.515517 + 0.802853 * t + 0.010328 * t * t) /
                           (1 + 1.432788 * t + 0.189269 * t * t + 0.001308 * t * t * t));
      for (int step = 0; step < 3; ++step) {
        x -= (0.5 * std::erfc(-x / std::sqrt(2.0)) - p) /
             (0.3989422804014327 * std::exp(-x * x / 2));
      }
      (*table)[i] = static_cast<float>(x);
      (*table)[kNormals - 1 - i] = static_cast<float>(-x);
    }
    return table;
  }();
  return *kTable;
}

// A Poisson number of the given mean from 40 + 16 random bits. Above 30 a normal one with the third moment put right.
float Poisson(float mean, float uniform, float normal) {
  if (mean <= 0) return 0;
  if (mean > 30) {
    return std::max(0.0f, std::round(mean + std::sqrt(mean) * normal + (normal * normal - 1) / 6));
  }
  float term = std::exp(-mean), sum = term;
  int k = 0;
  while (uniform > sum && k < 200) {
    term *= mean / static_cast<float>(++k);
    sum += term;
  }
  return static_cast<float>(k);
}

// Which channel a pixel of a Bayer mosaic has: index by 2·(y odd) + (x odd).
std::array<int, 4> Mosaic(PixelFormat format) {
  switch (format) {
    case PixelFormat::kBayerRG8:
    case PixelFormat::kBayerRG16:
      return {0, 1, 1, 2};
    case PixelFormat::kBayerGR8:
    case PixelFormat::kBayerGR16:
      return {1, 0, 2, 1};
    case PixelFormat::kBayerGB8:
    case PixelFormat::kBayerGB16:
      return {1, 2, 0, 1};
    default:
      return {2, 1, 1, 0};
  }
}

class Chip {
 public:
  Chip(const SensorOptions& sensor, PixelFormat format, int bits, double gain_db, uint64_t key,
       uint64_t pattern_key)
      : sensor_(sensor),
        key_(key),
        pattern_key_(pattern_key),
        patterned_(sensor.dsnu_e > 0 || sensor.prnu > 0),
        full_scale_(static_cast<float>((1 << SignificantBits(format, bits)) - 1)),
        black_(static_cast<float>(sensor.black_level) * full_scale_ /
               static_cast<float>((1 << bits) - 1)),
        gain_(static_cast<float>(std::pow(10.0, gain_db / 20) / sensor.full_well_e)),
        sensitivity_(static_cast<float>(sensor.sensitivity_e)),
        well_(static_cast<float>(sensor.full_well_e)),
        read_noise_(static_cast<float>(sensor.read_noise_e)),
        normals_(NormalQuantiles()) {}

  uint32_t Code(float exposure, uint64_t place) const {
    float electrons = exposure * sensitivity_, offset = 0;
    if (patterned_) {
      const uint64_t pixel = Mix(pattern_key_ + place * 0x9e3779b97f4a7c15u);
      electrons *= std::max(0.0f, 1 + static_cast<float>(sensor_.prnu) * normals_[pixel & 0xffff]);
      offset = static_cast<float>(sensor_.dsnu_e) * normals_[pixel >> 48];
    }
    const uint64_t random = Mix(key_ + place * 0x9e3779b97f4a7c15u);
    if (sensor_.photon_noise) {
      electrons = Poisson(electrons, static_cast<float>((random >> 24) & 0xffffff) * 0x1p-24f,
                          normals_[random & 0xffff]);
    }
    electrons = std::min(electrons, well_) + offset;
    if (read_noise_ > 0) electrons += read_noise_ * normals_[random >> 48];
    float signal = electrons * gain_;
    if (!sensor_.response.empty()) signal = Respond(signal);
    // Never negative, and a call per sample would keep the loop from being vectorised. NOLINTNEXTLINE(bugprone-incorrect-roundings)
    return static_cast<uint32_t>(std::clamp(signal * full_scale_ + black_, 0.0f, full_scale_) +
                                 0.5f);
  }

 private:
  float Respond(float signal) const {
    const auto last = static_cast<float>(sensor_.response.size() - 1);
    const float at = std::clamp(signal, 0.0f, 1.0f) * last;
    const auto k = std::min(static_cast<size_t>(at), sensor_.response.size() - 2);
    const auto a = static_cast<float>(sensor_.response[k]);
    const auto b = static_cast<float>(sensor_.response[k + 1]);
    return a + (b - a) * (at - static_cast<float>(k));
  }

  const SensorOptions& sensor_;
  const uint64_t key_, pattern_key_;
  const bool patterned_;
  const float full_scale_, black_, gain_, sensitivity_, well_, read_noise_;
  const std::vector<float>& normals_;
};

void PutCode(uint32_t code, int bytes, std::byte* to) {
  to[0] = static_cast<std::byte>(code & 0xff);
  if (bytes == 2) to[1] = static_cast<std::byte>(code >> 8);
}

}  // namespace

int SignificantBits(PixelFormat format, int bits) { return BytesPerSample(format) == 1 ? 8 : bits; }

std::vector<std::byte> ReadSensor(const Image& exposure, const SensorOptions& sensor,
                                  PixelFormat format, int bits, double gain_db, uint64_t noise_key,
                                  uint64_t pattern_key) {
  const Chip chip(sensor, format, bits, gain_db, noise_key, pattern_key);
  const int width = exposure.width(), bytes = BytesPerSample(format);
  const int samples = SamplesPerPixel(format);
  const bool bayer = IsBayer(format);
  const std::array<int, 4> mosaic = Mosaic(format);
  const size_t row_bytes = static_cast<size_t>(width) * samples * bytes;
  std::vector<std::byte> data(row_bytes * exposure.height());
  ForAll(exposure.height(), [&](int y) {
    std::span<const float> row = exposure.row(y);
    std::byte* out = data.data() + row_bytes * y;
    for (int x = 0; x < width; ++x) {
      const uint64_t place = (static_cast<uint64_t>(y) * width + x) * 3;
      const float* rgb = &row[3 * static_cast<size_t>(x)];
      if (samples == 3) {
        for (int c = 0; c < 3; ++c, out += bytes) PutCode(chip.Code(rgb[c], place + c), bytes, out);
        continue;
      }
      const int c = bayer ? mosaic[2 * (y & 1) + (x & 1)] : 0;
      const float light = bayer ? rgb[c] : (rgb[0] + rgb[1] + rgb[2]) / 3;
      PutCode(chip.Code(light, place + c), bytes, out);
      out += bytes;
    }
  });
  return data;
}

}  // namespace lightstage::sim
