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

// Wide enough that camera, lamps and projector are within. The camera stands before −Y's wall and looks at +Y's.
constexpr float kWall = 2.2f, kFloor = -0.9f, kCeiling = 2.2f;

Rgb Parquet(const Vec3f& p) {
  // Boards of 14 cm, each shifted and of its own tone.
  const float board = std::floor(p.x() / 0.14f);
  const float tone = UnitFloat(Mix(static_cast<uint64_t>(board + 100)));
  const float along = p.y() / 0.9f + tone;
  const float other = UnitFloat(Fold(Mix(static_cast<uint64_t>(board + 100)),
                                     static_cast<uint64_t>(std::floor(along) + 100)));
  const bool gap = p.x() / 0.14f - board < 0.03f || along - std::floor(along) < 0.005f;
  const float grain = Grain(90 * p.x() + 7 * tone, 3 * p.y());
  return Rgb(0.50f, 0.31f, 0.17f) * (gap ? 0.35f : 0.62f + 0.25f * other + 0.15f * grain);
}

// The window, painted on: sky over a hill, between bars.
Rgb Window(float x, float z, bool* hit) {
  *hit = std::abs(x) < 0.72f && z > 0.0f && z < 1.5f;
  const bool frame = std::abs(x) > 0.65f || z < 0.07f || z > 1.43f || std::abs(x) < 0.025f ||
                     std::abs(z - 0.95f) < 0.025f;
  if (frame) return Rgb::Constant(0.72f);
  if (z < 0.38f + 0.07f * std::sin(4 * x)) return {0.35f, 0.60f, 0.22f};
  return Rgb(0.60f, 0.82f, 0.97f) + Rgb(0.35f, 0.15f, 0.0f) * std::max(0.0f, 1.2f - z);
}

Rgb Walls(const SurfacePoint& at) {
  const Vec3f& p = at.position;
  constexpr float kNear = 1e-3f;
  if (p.z() < kFloor + kNear) return Parquet(p);
  if (p.z() > kCeiling - kNear) return Rgb::Constant(0.82f);
  if (p.z() < kFloor + 0.12f) return Rgb::Constant(0.70f);  // a skirting board
  if (p.x() < -kWall + kNear) {
    bool window;
    const Rgb view = Window(p.y() + 0.1f, p.z(), &window);
    return window ? view : Rgb(0.68f, 0.24f, 0.16f);
  }
  if (p.x() > kWall - kNear) return {0.16f, 0.40f, 0.42f};
  // Wallpaper with stripes, over a wainscot before and behind.
  if (p.z() < -0.05f) {
    const float panel = p.x() / 0.44f - std::floor(p.x() / 0.44f);
    const bool groove = std::abs(panel - 0.5f) > 0.40f && std::abs(panel - 0.5f) < 0.43f;
    return Rgb(0.74f, 0.70f, 0.60f) * (groove || p.z() > -0.09f ? 0.6f : 1.0f);
  }
  return std::sin(p.x() * 2 * kPi / 0.22f) > 0 ? Rgb(0.76f, 0.66f, 0.42f)
                                               : Rgb(0.70f, 0.58f, 0.34f);
}

// An abstract: discs and a diagonal on a dark ground, over [−1,1]².
Rgb Painting(float x, float y) {
  if (std::hypot(x - 0.35f, y - 0.30f) < 0.38f) return {0.88f, 0.62f, 0.08f};
  if (std::abs(y + 0.15f + 0.5f * x) < 0.10f) return {0.85f, 0.82f, 0.74f};
  if (std::hypot(x + 0.45f, y + 0.25f) < 0.34f) return {0.70f, 0.08f, 0.07f};
  if (y < -0.55f + 0.1f * std::sin(5 * x)) return {0.08f, 0.30f, 0.18f};
  return {0.05f, 0.12f, 0.34f};
}

class Furniture {
 public:
  explicit Furniture(Builder* b)
      : b_(b),
        oak_(b->Matte(Rgb(1, 1, 0.9f), Wood)),
        dark_(b->Plastic({0.11f, 0.055f, 0.03f}, 0.35f)),
        white_(b->Matte(Rgb::Constant(0.78f))) {}

  // On the wall behind the camera, which the ball shows in its middle.
  void Picture() {
    constexpr float kX = 0.60f, kZ = 0.85f, kHalfX = 0.55f, kHalfZ = 0.42f;
    b_->Put(Box({kX, -kWall + 0.02f, kZ}, {kHalfX + 0.05f, 0.02f, kHalfZ + 0.05f}), dark_);
    b_->Put(Box({kX, -kWall + 0.025f, kZ}, {kHalfX, 0.02f, kHalfZ}),
            b_->Matte(Rgb::Ones(), [](const SurfacePoint& at) {
              return Painting((at.position.x() - kX) / kHalfX, (at.position.z() - kZ) / kHalfZ);
            }));
  }

  void Table(const Vec3f& at, float half_x, float half_y, float height) {
    b_->Put(Box(at + Vec3f(0, 0, height - 0.02f), {half_x, half_y, 0.02f}), oak_);
    for (float x : {-1.0f, 1.0f}) {
      for (float y : {-1.0f, 1.0f}) {
        Vec3f foot = at + Vec3f(x * (half_x - 0.05f), y * (half_y - 0.05f), 0);
        const float half = 0.5f * (height - 0.04f);
        b_->Put(Box(foot + Vec3f(0, 0, half), {0.025f, 0.025f, half}), oak_);
      }
    }
  }

  // `yaw` 0: whoever sits on it looks along −Y.
  void Chair(const Vec3f& at, float yaw) {
    std::vector<Mesh> parts = {Box({0, 0, 0.44f}, {0.20f, 0.20f, 0.02f})};
    for (float x : {-0.18f, 0.18f}) {
      parts.push_back(Box({x, -0.18f, 0.21f}, {0.018f, 0.018f, 0.21f}));
      parts.push_back(Box({x, 0.18f, 0.44f}, {0.018f, 0.018f, 0.44f}));
    }
    for (float z : {0.60f, 0.72f, 0.84f}) {
      parts.push_back(Box({0, 0.18f, z}, {0.18f, 0.010f, 0.030f}));
    }
    Mesh chair = Joined(parts);
    chair.placements.push_back(
        Eigen::Affine3f(Eigen::Translation3f(at) * Eigen::AngleAxisf(yaw, Vec3f::UnitZ())));
    b_->Put(std::move(chair), dark_);
  }

  // Against +X's wall.
  void Shelf() {
    constexpr float kDeep = 0.14f, kHalf = 0.75f, kStep = 0.36f;
    constexpr int kBoards = 6;
    const float x = kWall - kDeep;
    const float top = kFloor + 0.04f + kStep * (kBoards - 1);
    for (int i = 0; i < kBoards; ++i) {
      const float z = kFloor + 0.04f + kStep * static_cast<float>(i);
      b_->Put(Box({x, 0, z}, {kDeep, kHalf, 0.012f}), white_);
    }
    for (float y : {-kHalf, 0.0f, kHalf}) {
      b_->Put(Box({x, y, 0.5f * (kFloor + top)}, {kDeep, 0.012f, 0.5f * (top - kFloor) + 0.012f}),
              white_);
    }
    const std::array<Rgb, 6> covers = {Rgb(0.60f, 0.10f, 0.08f), Rgb(0.10f, 0.20f, 0.45f),
                                       Rgb(0.12f, 0.34f, 0.16f), Rgb(0.74f, 0.64f, 0.42f),
                                       Rgb(0.09f, 0.08f, 0.09f), Rgb(0.72f, 0.38f, 0.08f)};
    std::array<std::vector<Mesh>, covers.size()> books;
    uint64_t key = 0;
    for (int i = 0; i + 1 < kBoards; ++i) {
      const float z = kFloor + 0.052f + kStep * static_cast<float>(i);
      for (float from : {-kHalf, 0.0f}) {
        // Some compartments are not full.
        float y = from + 0.016f;
        const float end = from + kHalf * (0.55f + 0.42f * UnitFloat(Mix(++key))) - 0.05f;
        while (y < end) {
          const float half = 0.010f + 0.016f * UnitFloat(Mix(++key));
          const float high = 0.095f + 0.055f * UnitFloat(Mix(++key));
          const float deep = 0.075f + 0.03f * UnitFloat(Mix(++key));
          books[Mix(++key) % books.size()].push_back(
              Box({kWall - 0.02f - deep, y + half, z + high}, {deep, half, high}));
          y += 2 * half + 0.001f;
        }
      }
    }
    for (size_t i = 0; i < covers.size(); ++i) {
      b_->Put(Joined(books[i]), b_->Matte(covers[i]));
    }
  }

  // Against -Y's wall, under the picture.
  void Sofa(float x) {
    const int cloth = b_->Matte({0.12f, 0.26f, 0.44f});
    const float y = -kWall + 0.42f;
    auto cushion = [&](const Vec3f& center, const Vec3f& half) {
      auto rib = [&](float along, float size) {
        return Section{center + Vec3f(along * half.x(), 0, 0),
                       {0, size * half.y(), 0},
                       {0, 0, size * half.z()}};
      };
      b_->Put(Loft({rib(-1, 0.55f), rib(-0.985f, 0.78f), rib(-0.95f, 0.93f), rib(-0.85f, 1),
                    rib(0.85f, 1), rib(0.95f, 0.93f), rib(0.985f, 0.78f), rib(1, 0.55f)},
                   64, 6, 5),
              cloth);
    };
    b_->Put(Box({x, y, kFloor + 0.12f}, {0.90f, 0.38f, 0.10f}), dark_);
    for (float side : {-1.0f, 1.0f}) {
      cushion({x + 0.41f * side, y + 0.04f, kFloor + 0.31f}, {0.405f, 0.36f, 0.10f});
      cushion({x + 0.41f * side, y - 0.27f, kFloor + 0.58f}, {0.405f, 0.10f, 0.22f});
      cushion({x + 0.90f * side, y, kFloor + 0.32f}, {0.10f, 0.39f, 0.27f});
    }
    b_->Put(Transformed(Blob(Vec3f::Zero(), {0.20f, 0.08f, 0.19f}, 64),
                        Eigen::Affine3f(Eigen::Translation3f(x - 0.45f, y - 0.08f, kFloor + 0.59f) *
                                        Eigen::AngleAxisf(0.35f, Vec3f::UnitX()))),
            b_->Matte({0.80f, 0.42f, 0.10f}));
  }

  // On the floor behind the ball, where the camera sees it: a basket of wool, and books.
  void Corner() {
    const Vec3f basket(-0.40f, 1.72f, kFloor);
    b_->Put(Lathe(basket,
                  Rounded({{0.11f, 0},
                           {0.11f, 0},
                           {0.15f, 0.10f},
                           {0.16f, 0.17f},
                           {0.16f, 0.17f},
                           {0.15f, 0.17f},
                           {0.15f, 0.17f},
                           {0.14f, 0.10f},
                           {0.10f, 0.02f}},
                          6),
                  96),
            b_->Matte(Rgb::Ones(), [basket](const SurfacePoint& at) -> Rgb {
              const Vec3f p = at.position - basket;
              const float around = 28 * std::atan2(p.y(), p.x()) / kPi;
              const float up = std::floor(p.z() / 0.022f);
              const bool over = std::fmod(std::floor(around) + up + 100, 2.0f) == 0;
              return Rgb(0.62f, 0.44f, 0.22f) * (over ? 1.0f : 0.6f);
            }));
    const std::array<Rgb, 5> wool = {Rgb(0.65f, 0.10f, 0.10f), Rgb(0.85f, 0.62f, 0.12f),
                                     Rgb(0.15f, 0.42f, 0.38f), Rgb(0.80f, 0.78f, 0.72f),
                                     Rgb(0.36f, 0.14f, 0.40f)};
    for (size_t i = 0; i < wool.size(); ++i) {
      const float a = 2 * kPi * static_cast<float>(i) / 4;
      const float out = i < 4 ? 0.074f : 0.0f, z = i < 4 ? 0.155f : 0.205f;
      b_->PutBall(basket + Vec3f(out * std::cos(a), out * std::sin(a), z), 0.062f,
                  b_->Matte(wool[i]));
    }
    const std::array<Rgb, 5> covers = {Rgb(0.10f, 0.20f, 0.45f), Rgb(0.74f, 0.64f, 0.42f),
                                       Rgb(0.60f, 0.10f, 0.08f), Rgb(0.12f, 0.34f, 0.16f),
                                       Rgb(0.72f, 0.38f, 0.08f)};
    float z = kFloor;
    for (size_t i = 0; i < covers.size(); ++i) {
      const float thick = 0.016f + 0.012f * UnitFloat(Mix(i + 40));
      const float yaw = 0.5f * (UnitFloat(Mix(i + 50)) - 0.5f);
      const Vec3f center(0.40f, 1.70f, z + thick), half(0.150f, 0.105f, thick);
      b_->Put(Box(center, half, yaw), b_->Matte(covers[i]));
      // The pages, a little less high and proud of the cover.
      b_->Put(Box(center, half + Vec3f(0.002f, 0.002f, -0.005f), yaw), white_);
      z += 2 * thick;
    }
    // A cup on them.
    b_->Put(Lathe({0.37f, 1.68f, z}, Rounded({{0.030f, 0},
                                              {0.030f, 0},
                                              {0.042f, 0.030f},
                                              {0.045f, 0.085f},
                                              {0.045f, 0.085f},
                                              {0.041f, 0.085f},
                                              {0.041f, 0.085f},
                                              {0.037f, 0.030f},
                                              {0.020f, 0.008f}},
                                             6)),
            b_->Plastic({0.78f, 0.76f, 0.70f}, 0.15f));
  }

  // In a corner, with leaves that arch.
  void Plant(const Vec3f& at) {
    b_->Put(Lathe(at, {{0.13f, 0.0f}, {0.17f, 0.30f}, {0.15f, 0.30f}, {0.14f, 0.27f}}, 64),
            b_->Matte({0.55f, 0.24f, 0.13f}));
    std::vector<Mesh> leaves;
    for (int i = 0; i < 18; ++i) {
      const float a = 2.4f * static_cast<float>(i), reach = 0.22f + 0.10f * UnitFloat(Mix(900 + i));
      const float high = 0.95f - 0.035f * static_cast<float>(i);
      const Vec3f out(std::cos(a), std::sin(a), 0), side(-std::sin(a), std::cos(a), 0);
      std::vector<Section> leaf =
          Rope({at + Vec3f(0, 0, 0.26f) + 0.02f * out,
                at + Vec3f(0, 0, 0.26f + 0.5f * high) + 0.25f * reach * out,
                at + Vec3f(0, 0, 0.26f + 0.85f * high) + 0.8f * reach * out,
                at + Vec3f(0, 0, 0.26f + 0.75f * high) + 1.25f * reach * out},
               1, side);
      constexpr float kWide[] = {0.006f, 0.030f, 0.040f, 0.003f};
      for (size_t k = 0; k < leaf.size(); ++k) {
        leaf[k].across *= kWide[k];
        leaf[k].up *= 0.003f;
      }
      leaves.push_back(Loft(leaf, 12, 8));
    }
    b_->Put(Joined(leaves), b_->Plastic({0.09f, 0.30f, 0.09f}, 0.4f));
  }

  void Rug() {
    b_->Put(Lathe({0, 0.35f, kFloor}, {{1.25f, 0.0f}, {1.25f, 0.012f}}, 128),
            b_->Matte(Rgb::Ones(), [](const SurfacePoint& at) {
              const float r = std::hypot(at.position.x(), at.position.y() - 0.35f);
              const float a = std::atan2(at.position.y() - 0.35f, at.position.x());
              if (r > 1.15f || std::abs(r - 0.75f) < 0.05f) return Rgb(0.62f, 0.52f, 0.36f);
              if (r > 0.8f) {
                return std::sin(24 * a) * std::sin(2 * kPi * (r - 0.8f) / 0.35f) > 0
                           ? Rgb(0.45f, 0.07f, 0.07f)
                           : Rgb(0.10f, 0.10f, 0.22f);
              }
              return std::sin(8 * a + 9 * r) > 0 ? Rgb(0.48f, 0.09f, 0.08f)
                                                 : Rgb(0.38f, 0.06f, 0.07f);
            }));
  }

 private:
  Builder* b_;
  int oak_, dark_, white_;
};

}  // namespace

SceneDescription Room() {
  Builder b;
  Mesh shell = InsideOut(
      Box({0, 0, 0.5f * (kFloor + kCeiling)}, {kWall, kWall, 0.5f * (kCeiling - kFloor)}));
  shell.name = "walls";
  b.Put(std::move(shell), b.Matte(Rgb::Ones(), Walls));
  Furniture furniture(&b);
  furniture.Picture();
  furniture.Shelf();
  furniture.Sofa(1.05f);
  furniture.Corner();
  furniture.Rug();
  furniture.Table({-1.15f, -1.20f, kFloor}, 0.55f, 0.38f, 0.74f);
  furniture.Chair({-1.10f, -0.70f, kFloor}, 0.15f);
  furniture.Chair({-0.35f, -1.55f, kFloor}, -1.9f);
  furniture.Plant({1.75f, 1.70f, kFloor});
  // A bowl of fruit on the table.
  const Vec3f table(-1.15f, -1.20f, kFloor + 0.74f);
  b.Put(
      Lathe(table, {{0.05f, 0.0f}, {0.05f, 0.01f}, {0.14f, 0.07f}, {0.13f, 0.07f}, {0.04f, 0.02f}}),
      b.Plastic({0.20f, 0.40f, 0.60f}, 0.2f));
  b.PutBall(table + Vec3f(0.05f, 0.01f, 0.075f), 0.04f, b.Plastic({0.80f, 0.35f, 0.04f}, 0.4f));
  b.PutBall(table + Vec3f(-0.04f, 0.04f, 0.075f), 0.04f, b.Plastic({0.55f, 0.05f, 0.04f}, 0.2f));
  b.PutBall(table + Vec3f(-0.02f, -0.05f, 0.075f), 0.04f, b.Plastic({0.45f, 0.60f, 0.08f}, 0.2f));

  // The ball, in the dish of a turned column.
  constexpr float kRadius = 0.09f, kLift = 0.0013f;
  b.PutBall({0, 0, kRadius + kLift}, kRadius, b.Mirror());
  b.Put(Lathe({0, 0, kFloor}, Rounded({{0.20f, 0.012f},
                                       {0.20f, 0.012f},
                                       {0.20f, 0.030f},
                                       {0.20f, 0.030f},
                                       {0.10f, 0.060f},
                                       {0.040f, 0.120f},
                                       {0.028f, 0.300f},
                                       {0.032f, 0.600f},
                                       {0.022f, 0.820f},
                                       {0.030f, 0.880f},
                                       {0.048f, 0.908f},
                                       {0.048f, 0.908f},
                                       {0.046f, 0.914f},
                                       {0.046f, 0.914f},
                                       {0.020f, 0.897f},
                                       {0.020f, 0.897f}},
                                      8)),
        b.Plastic({0.10f, 0.05f, 0.03f}, 0.25f));
  return b.Take();
}

}  // namespace lightstage::sim
