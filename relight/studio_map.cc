#include "relight/studio_map.h"

#include <cmath>

#include "optics/direction.h"
#include "optics/environment_map.h"

namespace lightstage::relight {
namespace {

constexpr int kSamples = 4;  // per side of a texel

Radiance Studio(double azimuth, double tilt) {  // degrees; azimuth in (−180, 180]
  static const Vec3 kLamp = DirectionFromAngles(Degrees(-65), Degrees(50));
  static const double kLampEdge = std::cos(Degrees(4).radians());
  const Vec3 direction = DirectionFromAngles(Degrees(azimuth), Degrees(tilt));
  if (direction.dot(kLamp) >= kLampEdge) return {150, 112, 72};
  if (azimuth > 20 && azimuth < 75 && tilt > 30 && tilt < 75) {
    const bool bar = std::abs(azimuth - 47.5) < 1 || std::abs(tilt - 52.5) < 1;
    return bar ? Radiance(0.1, 0.1, 0.1) : Radiance(5.0, 5.6, 6.4);
  }
  const double behind = 180 - std::abs(azimuth);
  if (behind < 9 && tilt > 25 && tilt < 85) return {0.9, 1.8, 4.2};
  if (tilt > 90) return Radiance(0.16, 0.13, 0.11);           // the floor
  return Radiance(0.42, 0.41, 0.40) * (1 - 0.6 * tilt / 90);  // ceiling to walls
}

}  // namespace

Image StudioMap(int width) {
  const int height = width / 2;
  Image image(width, height, 3);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      Radiance sum = Radiance::Zero();
      for (int j = 0; j < kSamples; ++j) {
        for (int i = 0; i < kSamples; ++i) {
          sum += Studio(180 - 360 * (x + (i + 0.5) / kSamples) / width,
                        180 * (y + (j + 0.5) / kSamples) / height);
        }
      }
      for (int c = 0; c < 3; ++c) {
        image.at(x, y, c) = static_cast<float>(sum[c] / (kSamples * kSamples));
      }
    }
  }
  return image;
}

}  // namespace lightstage::relight
