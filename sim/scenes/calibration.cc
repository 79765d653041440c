#include <algorithm>
#include <cmath>

#include "sim/scenes/builder.h"
#include "sim/scenes/shipped.h"

namespace lightstage::sim {
namespace {

// A hill of `height` around a direction, as wide as an angle of `width` radians.
float Hill(const Vec3f& direction, const Vec3f& where, float width, float height) {
  Vec3f off = direction - where.normalized();
  return height * std::exp(-off.squaredNorm() / (width * width));
}

// A face that looks along −Y.
float Face(const Vec3f& d) {
  float r = 1;
  // The jaw is narrower than the skull, and the face flatter than the back of the head.
  r -= 0.10f * std::pow(std::max(0.0f, -d.z()), 2.0f) * std::abs(d.x());
  r -= Hill(d, {0, -1, -0.15f}, 0.55f, 0.05f);
  for (float x : {-1.0f, 1.0f}) {
    r -= Hill(d, {0.33f * x, -1, 0.02f}, 0.19f, 0.075f);    // sockets
    r += Hill(d, {0.31f * x, -1, 0.02f}, 0.10f, 0.050f);    // eyes
    r -= Hill(d, {0.31f * x, -1, -0.035f}, 0.05f, 0.012f);  // under the lids
    r += Hill(d, {0.22f * x, -1, 0.20f}, 0.11f, 0.022f);    // brows
    r += Hill(d, {0.40f * x, -1, 0.20f}, 0.11f, 0.022f);
    r += Hill(d, {0.52f * x, -1, -0.30f}, 0.22f, 0.040f);    // cheeks
    r += Hill(d, {0.095f * x, -1, -0.335f}, 0.06f, 0.045f);  // nostrils
    r += Hill(d, {0.07f * x, -1, -0.55f}, 0.08f, 0.030f);    // lips
    r += Hill(d, {0.06f * x, -1, -0.72f}, 0.09f, 0.034f);
    r -= Hill(d, {0.07f * x, -1, -0.63f}, 0.045f, 0.030f);
    r -= Hill(d, {0.20f * x, -1, -0.63f}, 0.06f, 0.025f);
    r += Hill(d, {1.0f * x, 0.12f, -0.05f}, 0.16f, 0.13f);  // ears
    r -= Hill(d, {1.0f * x, -0.05f, -0.03f}, 0.09f, 0.05f);
  }
  // The nose: a ridge that grows downwards.
  for (int i = 0; i < 8; ++i) {
    auto f = static_cast<float>(i) / 7;
    r += Hill(d, {0, -1, 0.12f - 0.45f * f}, 0.08f, 0.022f + 0.050f * f * f);
  }
  r += Hill(d, {0, -1, -1.15f}, 0.24f, 0.110f);  // chin
  // Hair, combed back in waves.
  const float hair = std::clamp(5 * (d.z() + 0.75f * d.y() - 0.08f), 0.0f, 1.0f);
  r += hair * (0.040f + 0.014f * std::sin(26 * d.x() + 5 * std::sin(5 * d.y() + 2 * d.z())));
  return r;
}

void PutBust(Builder* b) {
  const int stone = b->Plastic(Rgb(0.66f, 0.58f, 0.46f), 0.45f);
  // It looks up a little, and aside.
  const Eigen::Affine3f head(Eigen::Translation3f(0, -0.004f, 0.137f) *
                             Eigen::AngleAxisf(0.25f, Vec3f::UnitZ()) *
                             Eigen::AngleAxisf(-0.20f, Vec3f::UnitX()));
  b->Put(Transformed(Blob(Vec3f::Zero(), {0.0335f, 0.0400f, 0.0460f}, 384, Face), head), stone);
  // Neck, shoulders and breast, cut off below as busts are.
  b->Put(Loft({{{0, 0.012f, 0.040f}, {0.026f, 0, 0}, {0, 0.020f, 0}},
               {{0, 0.011f, 0.050f}, {0.046f, 0, 0}, {0, 0.027f, 0}},
               {{0, 0.010f, 0.064f}, {0.060f, 0, 0}, {0, 0.029f, 0}},
               {{0, 0.010f, 0.074f}, {0.058f, 0, 0}, {0, 0.026f, 0}},
               {{0, 0.010f, 0.082f}, {0.038f, 0, 0}, {0, 0.022f, 0}},
               {{0, 0.010f, 0.090f}, {0.021f, 0, 0}, {0, 0.019f, 0}},
               {{0, 0.007f, 0.104f}, {0.018f, 0, 0}, {0, 0.0185f, 0}},
               {{0, 0.004f, 0.124f}, {0.020f, 0, 0}, {0, 0.020f, 0}}},
              96, 10),
         stone);
  b->Put(Lathe({0, 0.010f, 0}, Rounded({{0.034f, 0},
                                        {0.034f, 0},
                                        {0.034f, 0.007f},
                                        {0.034f, 0.007f},
                                        {0.028f, 0.010f},
                                        {0.016f, 0.016f},
                                        {0.013f, 0.026f},
                                        {0.017f, 0.036f},
                                        {0.022f, 0.041f}},
                                       8)),
         b->Plastic(Rgb(0.06f, 0.06f, 0.065f), 0.2f));
}

}  // namespace

SceneDescription Calibration() {
  Builder b;
  PutGround(&b);
  PutBust(&b);
  // Spheres of known shape and colour at four corners: what lights the object can be measured on them.
  constexpr float kRadius = 0.022f;
  const int white = b.Matte(Rgb::Constant(0.85f));
  const int post = b.Matte(Rgb::Constant(0.04f));
  for (float x : {-0.118f, 0.118f}) {
    for (float z : {kRadius + 0.006f, 0.150f}) {
      const Vec3f center(x, z < 0.1f ? -0.020f : 0.030f, z);
      b.PutBall(center, kRadius, white);
      b.Put(
          Lathe({center.x(), center.y(), 0},
                {{0.012f, 0.0f}, {0.012f, 0.004f}, {0.003f, 0.0055f}, {0.003f, z - 0.8f * kRadius}},
                48),
          post);
    }
  }
  return b.Take();
}

}  // namespace lightstage::sim
