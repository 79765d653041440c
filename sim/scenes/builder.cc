#include "sim/scenes/builder.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace lightstage::sim {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;

// A sine to 1e-3: a refined parabola. Textures are asked for every ray.
inline float Wave(float x) {
  constexpr float kPerTurn = 1 / (2 * kPi);
  const float turns = kPerTurn * x;
  const float t = turns - static_cast<float>(static_cast<int>(turns + std::copysign(0.5f, turns)));
  const float y = 8 * t - 16 * t * std::abs(t);
  return y * (0.775f + 0.225f * std::abs(y));
}

float Length(float x, float y) { return std::sqrt(x * x + y * y); }

Rgb Turntable(const SurfacePoint& at) {
  const Vec3f& p = at.position;
  float radius = Length(p.x(), p.y());
  // A graduation every 5.625°, the steps of 64 azimuths.
  if (radius > 0.215f && radius < 0.235f) {
    float step = std::abs(std::remainder(std::atan2(p.y(), p.x()), 2 * kPi / 64)) * radius;
    if (step < 0.0008f) return Rgb::Constant(0.15f);
  }
  return Rgb::Constant(0.92f + 0.08f * Grain(900 * radius, 3));
}

}  // namespace

float Grain(float x, float y) {
  float v = Wave(x) + 0.5f * Wave(2.3f * x + 1.7f * Wave(0.9f * y)) +
            0.25f * Wave(5.1f * x + 2.0f * y) + 0.2f * Wave(11.3f * x - 3.1f * y);
  return std::clamp(0.5f + 0.27f * v, 0.0f, 1.0f);
}

Rgb Wood(const SurfacePoint& at) {
  const Vec3f& p = at.position;
  // Rings around a trunk whose axis lies far off, stretched along the planks.
  float ring = Length(p.y() + 0.31f + 0.02f * Wave(9 * p.x()), 0.6f * p.z() + 0.05f);
  float tone = Grain(420 * ring, 14 * p.x());
  return Rgb(0.62f, 0.38f, 0.20f) * (0.55f + 0.45f * tone);
}

void PutGround(Builder* b) {
  b->Put(Floor(3, -0.05f), b->Matte(Rgb::Constant(0.06f)));
  int top = b->Add({.diffuse = Rgb(0.42f, 0.43f, 0.45f), .texture = Turntable});
  b->Put(
      Lathe(Vec3f::Zero(), {{0.236f, -0.03f}, {0.24f, -0.026f}, {0.24f, -0.004f}, {0.236f, 0.0f}}),
      top);
}

}  // namespace lightstage::sim
