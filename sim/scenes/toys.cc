#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "sim/render/hash.h"
#include "sim/scenes/builder.h"
#include "sim/scenes/shipped.h"

namespace lightstage::sim {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;

// What toys are sewn from: turned ellipsoids.
struct Part {
  Vec3f center, radii;
  Eigen::Matrix3f turn = Eigen::Matrix3f::Identity();
  Eigen::Affine3f Pose() const { return Eigen::Affine3f(Eigen::Translation3f(center) * turn); }
  // Below 1 inside.
  float Depth(const Vec3f& p) const {
    return (turn.transpose() * (p - center)).cwiseQuotient(radii).norm();
  }
};

// About X, then about Y.
Eigen::Matrix3f Turn(float pitch, float roll) {
  return (Eigen::AngleAxisf(roll, Vec3f::UnitY()) * Eigen::AngleAxisf(pitch, Vec3f::UnitX()))
      .toRotationMatrix();
}

void AddHair(const Vec3f& root, const Vec3f& tip, const Vec3f& skin, float width, float tone,
             Mesh* fur) {
  // A long tetrahedron whose short side is buried in the skin.
  const auto first = static_cast<uint32_t>(fur->vertices.size());
  const Vec3f along = (tip - root).normalized(), u = along.unitOrthogonal(), v = along.cross(u);
  Vec3f foot[3];
  for (int i = 0; i < 3; ++i) {
    const float a = 2 * kPi * static_cast<float>(i) / 3;
    foot[i] = root + width * (std::cos(a) * u + std::sin(a) * v);
  }
  auto add = [&](const Vec3f& p, const Vec3f& normal, float height) {
    fur->vertices.push_back(p);
    fur->normals.push_back(normal);
    fur->uvs.emplace_back(height, tone);
  };
  for (int i = 0; i < 3; ++i) {
    const Vec3f &a = foot[i], &b = foot[(i + 1) % 3];
    const Vec3f face = (b - a).cross(tip - a).normalized();
    // A hair is lit much as the pelt around it is.
    const Vec3f normal = (face + 0.7f * std::max(0.0f, 0.2f + face.dot(skin)) * skin).normalized();
    add(a, normal, 0);
    add(b, normal, 0);
    add(tip, normal, 1);
    const uint32_t k = first + 3 * static_cast<uint32_t>(i);
    fur->triangles.push_back({k, k + 1, k + 2});
  }
  for (int i : {0, 2, 1}) add(foot[i], -along, 0);
  fur->triangles.push_back({first + 9, first + 10, first + 11});
}

// Hairs all over a part, but not where it is inside another one.
void Grow(const std::vector<Part>& parts, size_t which, float length, Mesh* fur) {
  const Part& part = parts[which];
  const Eigen::Matrix3f& turn = part.turn;
  const Vec3f& r = part.radii;
  constexpr float kPerArea = 0.80e6f;  // 1/m²
  // Thomsen's mean of the radii; good to a percent.
  auto mean = [](float a, float b, float c) {
    return std::pow((std::pow(a * b, 1.6f) + std::pow(a * c, 1.6f) + std::pow(b * c, 1.6f)) / 3,
                    1 / 1.6f);
  };
  const int hairs = static_cast<int>(kPerArea * 4 * kPi * mean(r.x(), r.y(), r.z()));
  for (int i = 0; i < hairs; ++i) {
    auto random = [&](uint64_t k) {
      return UnitFloat(Fold(Mix(which * 8 + k), static_cast<uint64_t>(i)));
    };
    // A spiral of equal areas.
    const float z = 1 - (2 * static_cast<float>(i) + 1) / static_cast<float>(hairs);
    const float a = 2.399963f * static_cast<float>(i), flat = std::sqrt(1 - z * z);
    const Vec3f d(flat * std::cos(a), flat * std::sin(a), z);
    const Vec3f root = part.center + turn * r.cwiseProduct(d);
    const Vec3f skin = (turn * d.cwiseQuotient(r)).normalized();
    if (root.z() < 0.001f || std::any_of(parts.begin(), parts.end(), [&](const Part& other) {
          return other.Depth(root) < 0.97f;
        })) {
      continue;
    }
    // Brushed downwards, in tufts, and every hair a little on its own.
    const Vec3f tuft(std::sin(310 * root.x() + 170 * root.z()), std::sin(290 * root.y() + 3),
                     std::sin(330 * root.z() + 120 * root.x()));
    const Vec3f own(random(1) - 0.5f, random(2) - 0.5f, random(3) - 0.5f);
    const Vec3f way = (skin + Vec3f(0, 0, -0.35f) + 0.28f * tuft + 0.8f * own).normalized();
    Vec3f tip = root + length * (0.7f + 0.6f * random(4)) * way;
    tip.z() = std::max(tip.z(), 0.0003f);
    AddHair(root - 0.0006f * skin, tip, skin, 0.00038f, random(5), fur);
  }
}

// Darker at the root; every hair of its own tone.
Rgb Pelt(const SurfacePoint& at) {
  return Rgb::Constant((0.62f + 0.38f * at.uv.x()) * (0.82f + 0.18f * at.uv.y()));
}

struct Coat {
  int skin, hair;
};

void PutFurry(const std::vector<Part>& parts, size_t first, size_t last, float length,
              const Coat& coat, Builder* b) {
  Mesh fur;
  for (size_t i = first; i < last; ++i) {
    b->Put(Transformed(Blob(Vec3f::Zero(), parts[i].radii, 48), parts[i].Pose()), coat.skin);
    Grow(parts, i, length, &fur);
  }
  b->Put(std::move(fur), coat.hair);
}

void PutBear(Builder* b) {
  const Vec3f at(-0.068f, 0.012f, -0.0025f);
  std::vector<Part> parts = {
      {{0, 0, 0.053f}, {0.043f, 0.038f, 0.050f}},                                      // body
      {{0, -0.008f, 0.124f}, {0.039f, 0.035f, 0.036f}},                                // head
      {{0.047f, -0.018f, 0.066f}, {0.0150f, 0.0160f, 0.0330f}, Turn(-0.55f, -0.50f)},  // arms
      {{-0.047f, -0.018f, 0.066f}, {0.0150f, 0.0160f, 0.0330f}, Turn(-0.55f, 0.50f)},
      {{0.031f, -0.045f, 0.021f}, {0.0185f, 0.0360f, 0.0190f}},  // legs
      {{-0.031f, -0.045f, 0.021f}, {0.0185f, 0.0360f, 0.0190f}},
      {{0.031f, 0.000f, 0.153f}, {0.0140f, 0.0085f, 0.0140f}, Turn(0, 0.4f)},  // ears
      {{-0.031f, 0.000f, 0.153f}, {0.0140f, 0.0085f, 0.0140f}, Turn(0, -0.4f)},
      {{0, -0.040f, 0.116f}, {0.0180f, 0.0150f, 0.0140f}},                  // muzzle
      {{0, -0.030f, 0.048f}, {0.0260f, 0.0120f, 0.0300f}, Turn(0.12f, 0)},  // belly
      {{0.031f, -0.078f, 0.022f}, {0.0135f, 0.0060f, 0.0140f}},             // soles
      {{-0.031f, -0.078f, 0.022f}, {0.0135f, 0.0060f, 0.0140f}},
  };
  for (Part& part : parts) part.center += at;
  const Coat brown = {b->Matte({0.16f, 0.085f, 0.04f}), b->Matte({0.52f, 0.29f, 0.13f}, Pelt)};
  const Coat cream = {b->Matte({0.40f, 0.28f, 0.17f}), b->Matte({0.82f, 0.66f, 0.45f}, Pelt)};
  PutFurry(parts, 0, 8, 0.0062f, brown, b);
  PutFurry(parts, 8, parts.size(), 0.0030f, cream, b);
  const int glossy = b->Plastic(Rgb::Constant(0.012f), 0.04f);
  for (float side : {-1.0f, 1.0f}) {
    b->PutBall(at + Vec3f(0.0150f * side, -0.0435f, 0.1345f), 0.0052f, glossy);
  }
  b->Put(Blob(at + Vec3f(0, -0.0560f, 0.1215f), {0.0070f, 0.0048f, 0.0052f}, 64), glossy);
  // The mouth: a stitch down from the nose, and one to either side.
  const int thread = b->Matte({0.05f, 0.03f, 0.02f});
  b->Put(Rod(at + Vec3f(0, -0.0590f, 0.1180f), at + Vec3f(0, -0.0578f, 0.1100f), 0.0008f), thread);
  for (float side : {-1.0f, 1.0f}) {
    b->Put(
        Loft(Rope({at + Vec3f(0, -0.0578f, 0.1100f), at + Vec3f(0.004f * side, -0.0565f, 0.1070f),
                   at + Vec3f(0.009f * side, -0.0535f, 0.1080f)},
                  0.0008f, Vec3f::UnitY()),
             12, 6),
        thread);
  }
}

// Loops of a terry cloth, on a unit sphere that becomes a part about `size` large.
float Terry(const Vec3f& d, float size) {
  const float f = size / 0.00062f;
  const Vec3f p = f * d + 1.1f * Vec3f(std::sin(0.31f * f * d.y()), std::sin(0.27f * f * d.z()),
                                       std::sin(0.29f * f * d.x()));
  const float loops = std::sin(p.x()) * std::sin(p.y() + 0.6f) + std::sin(p.y()) * std::sin(p.z()) +
                      std::sin(p.z() + 0.4f) * std::sin(p.x() + 1.3f);
  return 1 + 0.00052f / size * loops;
}

void PutTerry(const Part& part, int segments, int material, Builder* b) {
  const float size = std::cbrt(part.radii.prod());
  b->Put(Transformed(Blob(Vec3f::Zero(), part.radii, segments,
                          [&](const Vec3f& d) { return Terry(d, size); }),
                     part.Pose()),
         material);
}

Rgb Stripes(const SurfacePoint& at) {
  const float a = std::atan2(at.position.y() - 0.010f, at.position.x() - 0.066f);
  return std::sin(22 * a) > 0 ? Rgb(0.70f, 0.09f, 0.07f) : Rgb(0.80f, 0.72f, 0.55f);
}

void PutRabbit(Builder* b) {
  const Vec3f at(0.066f, 0.010f, -0.0012f);
  const int blue = b->Matte({0.30f, 0.42f, 0.56f});
  const int white = b->Matte({0.80f, 0.77f, 0.72f});
  const int pink = b->Matte({0.76f, 0.42f, 0.40f});
  auto put = [&](Part part, int segments, int material) {
    part.center += at;
    PutTerry(part, segments, material, b);
  };
  put({{0, 0, 0.047f}, {0.037f, 0.034f, 0.046f}}, 260, blue);
  put({{0, -0.008f, 0.110f}, {0.034f, 0.031f, 0.031f}}, 232, blue);
  put({{0, -0.020f, 0.042f}, {0.026f, 0.0175f, 0.032f}}, 144, white);
  for (float side : {-1.0f, 1.0f}) {
    put({{0.012f * side, -0.034f, 0.101f}, {0.0125f, 0.0105f, 0.0100f}}, 96, white);  // cheeks
    put({{0.037f * side, -0.014f, 0.060f},
         {0.0115f, 0.0120f, 0.0270f},
         Turn(-0.45f, -0.35f * side)},
        144, blue);
    put({{0.026f * side, -0.043f, 0.0165f}, {0.0155f, 0.0310f, 0.0160f}}, 158, blue);
    put({{0.026f * side, -0.0685f, 0.0170f}, {0.0100f, 0.0065f, 0.0105f}}, 80, pink);
    // Ears, one of them tired.
    const float lean = side > 0 ? 0.75f : -0.14f;
    const Vec3f root(0.014f * side, 0.002f, 0.134f);
    const Vec3f along(std::sin(lean), 0, std::cos(lean));
    put({root + 0.030f * along, {0.0125f, 0.0065f, 0.0370f}, Turn(0, lean)}, 158, blue);
    put({root + 0.031f * along + Vec3f(0, -0.0046f, 0), {0.0080f, 0.0035f, 0.0290f}, Turn(0, lean)},
        96, pink);
  }
  const int glossy = b->Plastic(Rgb::Constant(0.012f), 0.04f);
  for (float side : {-1.0f, 1.0f}) {
    b->PutBall(at + Vec3f(0.0135f * side, -0.0352f, 0.1205f), 0.0046f, glossy);
  }
  b->Put(Blob(at + Vec3f(0, -0.0445f, 0.1085f), {0.0045f, 0.0035f, 0.0032f}, 48),
         b->Plastic({0.55f, 0.14f, 0.16f}, 0.2f));
  // A scarf around the neck, its end hanging down in front.
  const int wool = b->Matte(Rgb::Ones(), Stripes);
  b->Put(Transformed(Torus(Vec3f::Zero(), 0.0245f, 0.0062f, 192, 48),
                     Eigen::Affine3f(Eigen::Translation3f(at + Vec3f(0, -0.004f, 0.0835f)))),
         wool);
  b->Put(Loft({{at + Vec3f(0.012f, -0.029f, 0.085f), {0, 0.0025f, 0}, {0.0060f, 0, 0}},
               {at + Vec3f(0.014f, -0.037f, 0.076f), {0, 0.0025f, 0}, {0.0065f, 0, 0}},
               {at + Vec3f(0.015f, -0.0405f, 0.064f), {0, 0.0022f, 0}, {0.0075f, 0, 0}},
               {at + Vec3f(0.016f, -0.0425f, 0.052f), {0, 0.0020f, 0}, {0.0085f, 0, 0}}},
              48, 12, 3),
         wool);
}

}  // namespace

SceneDescription Toys() {
  Builder b;
  PutGround(&b);
  PutBear(&b);
  PutRabbit(&b);
  return b.Take();
}

}  // namespace lightstage::sim
