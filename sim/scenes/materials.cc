#include <algorithm>
#include <array>
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

// The board's own frame: X to the right, Y up along it, the bottom of its four trays at z = 0.
constexpr float kX = 0.0615f, kY = 0.0555f;          // middles of the quadrants
constexpr float kHalfX = 0.0585f, kHalfY = 0.0525f;  // and their half sizes

// It leans back, so that the camera sees all of it.
Eigen::Affine3f BoardPose() {
  return Eigen::Affine3f(Eigen::Translation3f(0, -0.005f, 0.0740f) *
                         Eigen::AngleAxisf(0.63f, Vec3f::UnitX()));
}

float Random(uint64_t what, uint64_t which) { return UnitFloat(Fold(Mix(what), which)); }

// The squared distance to the nearest of points scattered one to a cell.
float Scatter(const Vec2f& p, float cell, uint64_t seed) {
  const int i = static_cast<int>(std::floor(p.x() / cell));
  const int j = static_cast<int>(std::floor(p.y() / cell));
  float nearest = 1e9f;
  for (int y = j - 2; y <= j + 2; ++y) {
    for (int x = i - 2; x <= i + 2; ++x) {
      const auto key = static_cast<uint64_t>(x + 512) * 1024 + static_cast<uint64_t>(y + 512);
      Vec2f site(static_cast<float>(x) + Random(seed, 2 * key),
                 static_cast<float>(y) + Random(seed, 2 * key + 1));
      nearest = std::min(nearest, (p - cell * site).squaredNorm());
    }
  }
  return nearest;
}

// Crumpled paper is flat between its creases: of two squared distances the squares cancel, and planes are left.
float Crumple(const Vec2f& p) {
  const float wide = Scatter(p, 0.030f, 1) - Scatter(p, 0.030f, 2);
  const float fine = Scatter(p, 0.011f, 3) - Scatter(p, 0.011f, 4);
  return 7.0f * wide + 9.0f * fine;
}

Mesh Paper() {
  return Surface(300, 270, false, false, [](float s, float t) {
    const Vec2f p((2 * s - 1) * kHalfX, (2 * t - 1) * kHalfY);
    // Glued down along its edges.
    const float edge = 2 * std::min({s, 1 - s, t, 1 - t});
    const float height = std::clamp(0.0052f + Crumple(p), 0.0004f, 0.0110f);
    return Vec3f(p.x(), p.y(), 0.0003f + height * std::min(1.0f, 16 * edge));
  });
}

Rgb DarkWood(const SurfacePoint& at) {
  Vec3f p = BoardPose().inverse() * at.position;
  // Every plank is another piece of the trunk.
  const float plank = std::floor((p.y() + 0.1f) / 0.0263f);
  p += Vec3f(0.37f * plank, 0.11f * plank, 0);
  const float pore = Grain(2600 * p.y(), 60 * p.x()) > 0.78f ? 0.7f : 1.0f;
  return Rgb(0.34f, 0.27f, 0.24f) * Wood({.position = {p.x(), p.y(), 0}}) * pore;
}

void PutPlanks(const Eigen::Affine3f& quadrant, Builder* b) {
  const int wood = b->Add({.diffuse = Rgb::Ones(),
                           .specular = Rgb::Constant(0.045f),
                           .roughness = 0.22f,
                           .texture = DarkWood});
  constexpr int kPlanks = 4;
  const float half = kHalfY / kPlanks;
  for (int i = 0; i < kPlanks; ++i) {
    // Rounded along their upper edges.
    const float y = half * static_cast<float>(2 * i - kPlanks + 1), h = half - 0.0003f;
    Vec3f across(0, h, 0), up(0, 0, 0.0040f);
    b->Put(Transformed(Loft({{{-kHalfX + 0.0005f, y, 0.0040f}, across, up},
                             {{kHalfX - 0.0005f, y, 0.0040f}, across, up}},
                            256, 2, 14),
                       quadrant),
           wood);
  }
}

void PutScatteringBalls(const Eigen::Affine3f& quadrant, Builder* b) {
  const int milk = b->Medium(0.0015f, Rgb(0.99f, 0.97f, 0.90f));
  constexpr int kColumns = 6, kRows = 6;
  constexpr float kRadius = 0.0086f;
  for (int j = 0; j < kRows; ++j) {
    for (int i = 0; i < kColumns; ++i) {
      // As close as they go without touching: media must not overlap.
      const float x = (static_cast<float>(i) - 2.75f + 0.5f * static_cast<float>(j % 2)) * 0.0180f;
      const float y = (static_cast<float>(j) - 2.5f) * 0.0172f;
      b->PutBall(quadrant * Vec3f(x, y, kRadius + 0.0002f), kRadius, milk);
    }
  }
}

Rgb Speckles(const SurfacePoint& at) {
  const Vec3f& p = at.position;
  const float coarse = Grain(700 * p.x() + 310 * p.z(), 650 * p.y());
  const float fine = Grain(5200 * p.x() - 2100 * p.z(), 4700 * p.y() + 900 * p.z());
  return Rgb::Constant(0.72f + 0.22f * coarse + (fine > 0.82f ? -0.25f : 0.1f * fine));
}

Mesh Stone(uint64_t seed) {
  // A few flats and hollows ground into an ellipsoid, and a rough skin.
  std::array<Vec3f, 9> flats;
  for (size_t i = 0; i < flats.size(); ++i) {
    const float z = 2 * Random(seed, 3 * i) - 1, a = 2 * kPi * Random(seed, 3 * i + 1);
    const float r = std::sqrt(1 - z * z);
    flats[i] = {r * std::cos(a), r * std::sin(a), z};
  }
  return Blob(Vec3f::Zero(), {1.0f, 0.78f, 0.60f}, 96, [&](const Vec3f& d) {
    float r = 1;
    for (size_t i = 0; i < flats.size(); ++i) {
      const float off = 0.80f + 0.15f * Random(seed, 100 + i);
      // Softened, or the edges would be knives.
      const float beyond = r * d.dot(flats[i]) - off;
      if (beyond > 0) r *= 1 - 0.85f * beyond / (off + beyond);
    }
    const float skin =
        std::sin(9 * d.x() + 4 * std::sin(5 * d.z())) * std::sin(8 * d.y() + 3 * d.z()) +
        0.5f * std::sin(21 * d.z() + 11 * d.x()) * std::sin(19 * d.y() - 7 * d.x());
    return r + 0.012f * skin;
  });
}

void PutStones(const Eigen::Affine3f& quadrant, Builder* b) {
  const std::array<Rgb, 5> colors = {Rgb(0.42f, 0.40f, 0.38f), Rgb(0.50f, 0.42f, 0.33f),
                                     Rgb(0.22f, 0.23f, 0.25f), Rgb(0.62f, 0.60f, 0.55f),
                                     Rgb(0.36f, 0.24f, 0.19f)};
  std::vector<Mesh> stones;
  for (size_t k = 0; k < colors.size(); ++k) stones.push_back(Stone(k + 1));
  auto lay = [&](float x, float y, float z, float size, uint64_t key) {
    const float yaw = 2 * kPi * Random(7, 4 * key), tip = 0.7f * (Random(7, 4 * key + 1) - 0.5f);
    x = std::clamp(x, -kHalfX + size, kHalfX - size);
    y = std::clamp(y, -kHalfY + size, kHalfY - size);
    Eigen::Affine3f place(Eigen::Translation3f(x, y, z) * Eigen::AngleAxisf(yaw, Vec3f::UnitZ()) *
                          Eigen::AngleAxisf(tip, Vec3f::UnitX()) *
                          Eigen::UniformScaling<float>(size));
    stones[key % stones.size()].placements.push_back(quadrant * place);
  };
  // A bed without gaps, and larger ones on it.
  uint64_t key = 0;
  for (int j = 0; j < 9; ++j) {
    for (int i = 0; i < 10; ++i) {
      const float x = (static_cast<float>(i) - 4.5f) * 0.0119f + 0.005f * (Random(8, key) - 0.5f);
      const float y = (static_cast<float>(j) - 4.0f) * 0.0119f + 0.005f * (Random(9, key) - 0.5f);
      lay(x, y, 0.0022f, 0.0072f + 0.0018f * Random(10, key), Mix(key) >> 8);
      ++key;
    }
  }
  for (int j = 0; j < 5; ++j) {
    for (int i = 0; i < 6; ++i) {
      const float x = (static_cast<float>(i) - 2.5f) * 0.0185f + 0.008f * (Random(8, key) - 0.5f);
      const float y = (static_cast<float>(j) - 2.0f) * 0.0195f + 0.008f * (Random(9, key) - 0.5f);
      lay(x, y, 0.0075f, 0.0075f + 0.0035f * Random(10, key), Mix(key) >> 8);
      ++key;
    }
  }
  for (size_t k = 0; k < colors.size(); ++k) {
    b->Put(std::move(stones[k]), b->Add({.diffuse = colors[k],
                                         .specular = Rgb::Constant(0.03f),
                                         .roughness = 0.5f,
                                         .texture = Speckles}));
  }
}

}  // namespace

SceneDescription Materials() {
  Builder b;
  PutGround(&b);
  const Eigen::Affine3f pose = BoardPose();
  const int frame = b.Matte(Rgb(0.10f, 0.10f, 0.11f));
  auto put = [&](const Vec3f& center, const Vec3f& half) {
    b.Put(Transformed(Box(center, half), pose), frame);
  };
  // A back plate, and strips around and between the quadrants.
  constexpr float kStrip = 0.003f, kHigh = 0.0045f, kWidth = kX + kHalfX, kHeight = kY + kHalfY;
  put({0, 0, -0.003f}, {kWidth + 2 * kStrip, kHeight + 2 * kStrip, 0.003f});
  put({0, 0, kHigh}, {kStrip, kHeight, kHigh});
  put({0, 0, kHigh}, {kWidth, kStrip, kHigh});
  for (float side : {-1.0f, 1.0f}) {
    put({side * (kWidth + kStrip), 0, kHigh}, {kStrip, kHeight + 2 * kStrip, kHigh});
    put({0, side * (kHeight + kStrip), kHigh}, {kWidth, kStrip, kHigh});
  }
  // What it leans on.
  b.Put(Box({0, 0.060f, 0.055f}, {0.090f, 0.006f, 0.055f}), frame);
  b.Put(Box({0, 0.020f, 0.004f}, {0.100f, 0.085f, 0.004f}), frame);
  auto quadrant = [&](float x, float y) {
    return Eigen::Affine3f(pose * Eigen::Translation3f(kX * x, kY * y, 0));
  };
  PutPlanks(quadrant(-1, 1), &b);
  b.Put(Transformed(Paper(), quadrant(1, 1)), b.Matte(Rgb(0.80f, 0.79f, 0.76f)));
  PutScatteringBalls(quadrant(-1, -1), &b);
  PutStones(quadrant(1, -1), &b);
  return b.Take();
}

}  // namespace lightstage::sim
