#include <cmath>
#include <numbers>

#include "sim/scenes/builder.h"
#include "sim/scenes/shipped.h"

namespace lightstage::sim {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;

// A trefoil knot of glazed porcelain on a turned foot.
void PutKnot(Builder* b) {
  const Vec3f center(-0.012f, 0.045f, 0.118f);
  auto knot = [center](float s) {
    float t = 2 * kPi * s, r = 0.040f + 0.0185f * std::cos(3 * t);
    // Standing up, its plane turned a little away from the camera.
    Vec3f flat(r * std::cos(2 * t), 0.0185f * std::sin(3 * t), r * std::sin(2 * t));
    const float c = std::cos(0.35f), n = std::sin(0.35f);
    return Vec3f(center +
                 Vec3f(c * flat.x() - n * flat.y(), n * flat.x() + c * flat.y(), flat.z()));
  };
  b->Put(Tube(knot, 0.0125f, 400, 32), b->Plastic(Rgb(0.78f, 0.76f, 0.70f), 0.18f));
  b->Put(Lathe({center.x(), center.y(), 0.012f}, {{0.034f, 0.0f},
                                                  {0.034f, 0.006f},
                                                  {0.030f, 0.010f},
                                                  {0.018f, 0.014f},
                                                  {0.013f, 0.022f},
                                                  {0.012f, 0.034f},
                                                  {0.016f, 0.040f},
                                                  {0.022f, 0.043f},
                                                  {0.022f, 0.047f}}),
         b->Plastic(Rgb(0.10f, 0.06f, 0.045f), 0.25f));
}

// A gourd: ribs that shadow each other.
void PutGourd(Builder* b) {
  const Vec3f center(-0.092f, -0.012f, 0.012f);
  b->Put(Surface(200, 64, true, false,
                 [center](float s, float t) {
                   float azimuth = 2 * kPi * s, height = kPi * (t - 0.5f);
                   float rib = std::abs(std::cos(5 * azimuth));
                   float r = 0.036f * std::cos(height) * (0.80f + 0.20f * std::sqrt(rib));
                   float dent = 0.010f * std::exp(-std::pow(std::cos(height) / 0.35f, 2.0f));
                   float z = 0.0275f * std::sin(height) + (height > 0 ? -dent : dent);
                   return Vec3f(center +
                                Vec3f(r * std::cos(azimuth), r * std::sin(azimuth), z + 0.0255f));
                 }),
         b->Matte(Rgb(0.85f, 0.36f, 0.07f)));
  b->Put(Tube(
             [center](float s) {
               // A stalk: there and back again, closed inside the gourd.
               float t = std::abs(2 * s - 1);
               return Vec3f(center +
                            Vec3f(0.010f * (1 - t) * (1 - t), 0.0f, 0.036f + 0.026f * (1 - t)) +
                            Vec3f(0, 0.0015f * std::sin(2 * kPi * s), 0));
             },
             0.0035f, 96, 24),
         b->Matte(Rgb(0.25f, 0.30f, 0.10f)));
}

// A curved fence of thin pickets: fine shadows that move fast with the light.
void PutFence(Builder* b) {
  constexpr int kPickets = 31;
  constexpr float kRadius = 0.125f, kFrom = -0.08f * kPi, kTo = 0.66f * kPi, kHalfHeight = 0.027f;
  const int white = b->Matte(Rgb(0.80f, 0.80f, 0.78f));
  for (int i = 0; i < kPickets; ++i) {
    float a = kFrom + (kTo - kFrom) * static_cast<float>(i) / (kPickets - 1);
    Vec3f foot(kRadius * std::cos(a), kRadius * std::sin(a), 0.012f);
    b->Put(Box(foot + Vec3f(0, 0, kHalfHeight), {0.0012f, 0.0024f, kHalfHeight}, a), white);
  }
  for (float z : {0.026f, 0.054f}) {
    b->Put(Surface(128, 4, false, true,
                   [&](float s, float t) {
                     // A square rail outside the pickets, a little longer than the row.
                     float a = kFrom - 0.03f + (kTo - kFrom + 0.06f) * s;
                     constexpr float kX[] = {1, 1, -1, -1}, kZ[] = {-1, 1, 1, -1};
                     int corner = static_cast<int>(std::lround(4 * t)) % 4;
                     float r = kRadius + 0.0024f + 0.0011f * kX[corner];
                     return Vec3f(r * std::cos(a), r * std::sin(a), z + 0.0016f * kZ[corner]);
                   }),
           white);
  }
}

void PutBalls(Builder* b) {
  b->Put(Sphere({0.078f, -0.022f, 0.012f + 0.033f}, 0.033f, 128),
         b->Plastic(Rgb(0.42f, 0.015f, 0.02f), 0.07f));
  b->Put(Sphere({0.020f, -0.075f, 0.012f + 0.021f}, 0.021f, 128),
         b->Metal(Rgb(0.95f, 0.70f, 0.32f), 0.16f));
  b->Put(Sphere({-0.040f, -0.085f, 0.012f + 0.014f}, 0.014f, 96),
         b->Matte(Rgb(0.82f, 0.82f, 0.82f)));
  b->Put(Sphere({0.066f, -0.078f, 0.012f + 0.012f}, 0.012f, 96),
         b->Plastic(Rgb(0.03f, 0.16f, 0.42f), 0.12f));
}

}  // namespace

SceneDescription StillLife() {
  Builder b;
  PutGround(&b);
  // The board that everything stands on.
  b.Put(
      Lathe(Vec3f::Zero(), {{0.150f, 0.0f}, {0.152f, 0.003f}, {0.152f, 0.009f}, {0.149f, 0.012f}}),
      b.Add({.diffuse = Rgb::Ones(),
             .specular = Rgb::Constant(0.04f),
             .roughness = 0.4f,
             .texture = Wood}));
  PutKnot(&b);
  PutGourd(&b);
  PutFence(&b);
  PutBalls(&b);
  return b.Take();
}

}  // namespace lightstage::sim
