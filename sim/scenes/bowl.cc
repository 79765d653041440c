#include <cmath>
#include <numbers>
#include <vector>

#include "sim/scenes/builder.h"
#include "sim/scenes/shipped.h"

namespace lightstage::sim {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;

// The outside from the pole to the rim and the inside back to the pole, all of it round.
std::vector<Vec2f> BowlProfile(float radius, float thickness) {
  std::vector<Vec2f> profile;
  constexpr int kRings = 80;
  const float rim = 0.5f * kPi, half = 0.5f * thickness, middle = radius - half;
  auto arc = [&](float r, float from, float to, float x, float z, int steps) {
    for (int i = 0; i <= steps; ++i) {
      float a = from + (to - from) * static_cast<float>(i) / static_cast<float>(steps);
      Vec2f p(x + r * std::sin(a), z - r * std::cos(a));
      if (profile.empty() || (p - profile.back()).norm() > 1e-5f) profile.push_back(p);
    }
  };
  arc(radius, 0, rim, 0, radius, kRings);
  arc(half, rim, rim + kPi, middle, radius, 16);
  arc(radius - thickness, rim, 0, 0, radius, kRings);
  profile.front().x() = profile.back().x() = 0;
  return profile;
}

}  // namespace

SceneDescription Bowl() {
  Builder b;
  PutGround(&b);
  constexpr float kRadius = 0.096f;
  // Half a sphere, its axis towards the camera.
  const Vec3f center(0, 0, 0.0985f);
  const Vec3f axis = (Vec3f(0, -1.1f, 0.55f) - center).normalized();
  Eigen::Affine3f pose(Eigen::Translation3f(center) *
                       Eigen::Quaternionf::FromTwoVectors(Vec3f::UnitZ(), axis) *
                       Eigen::Translation3f(0, 0, -kRadius));
  const int white = b.Matte(Rgb::Constant(0.8f));
  b.Put(Transformed(Lathe(Vec3f::Zero(), BowlProfile(kRadius, 0.006f), 256), pose), white);
  // Two rails carry it, and an upright behind keeps it from rolling over.
  const int dark = b.Plastic(Rgb(0.07f, 0.06f, 0.06f), 0.3f);
  for (float side : {-1.0f, 1.0f}) {
    b.Put(Box({0.050f * side, 0.030f, 0.0065f}, {0.006f, 0.075f, 0.0065f}), dark);
  }
  b.Put(Box({0, 0.100f, 0.028f}, {0.070f, 0.008f, 0.028f}), dark);
  return b.Take();
}

}  // namespace lightstage::sim
