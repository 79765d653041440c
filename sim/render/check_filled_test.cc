// What glass and media must not do, shape against shape and within a mesh.
#include "sim/render/check_filled.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>

#include "sim/render/separation.h"
#include "sim/render/shapes.h"
#include "sim/render/test_scene.h"

namespace lightstage::sim {
namespace {

const std::vector<Material> kMaterials = {{.diffuse = Rgb::Constant(0.5f)},
                                          {.kind = Material::Kind::kGlass},
                                          {.kind = Material::Kind::kMedium, .extinction = 200}};
enum { kClay, kGlass, kFoam };

// Parts of one mesh of this material.
Mesh Of(int material, const std::vector<Mesh>& parts) {
  Mesh mesh = Joined(parts);
  mesh.material = material;
  return mesh;
}
Mesh BoxOf(int material, const Vec3f& center, const Vec3f& half, float yaw = 0) {
  return Of(material, {Box(center, half, yaw)});
}

absl::Status Build(std::vector<Mesh> meshes, std::vector<Ball> balls = {}) {
  return Scene::Build({kMaterials, std::move(meshes), std::move(balls)}).status();
}

void ExpectRefused(const absl::Status& status, const std::vector<std::string>& words) {
  EXPECT_FALSE(status.ok());
  for (const std::string& word : words)
    EXPECT_NE(status.message().find(word), std::string::npos) << word << ": " << status;
}

const Vec3f kCube = Vec3f::Constant(0.05f);

TEST(Media, LeaveAGapToEachOtherAndToGlass) {
  for (int other : {kGlass, kFoam}) {
    for (float yaw : {0.0f, 0.3f}) {
      const Vec3f along(std::cos(yaw), std::sin(yaw), 0), across(-along.y(), along.x(), 0);
      auto two = [&](const Vec3f& to, const Vec3f& half) {
        return Build({BoxOf(kFoam, Vec3f::Zero(), kCube, yaw), BoxOf(other, to, half, yaw)});
      };
      ExpectRefused(two(0.1f * along, kCube), {"mesh 0 and mesh 1 overlap or touch", "gap"});
      ExpectRefused(two(0.1f * along + 0.02f * across, {0.05f, 0.01f, 0.01f}), {"gap"});
      ExpectRefused(two(0.1f * along + 0.1f * across, kCube), {"gap"});
      // At an edge and at a corner, by a tenth of a millimetre.
      ExpectRefused(two(0.0999f * (along + across), kCube), {"gap"});
      ExpectRefused(two(0.0999f * (along + across + Vec3f::UnitZ()), kCube), {"gap"});
      // Bars that cross, within and at the top.
      ExpectRefused(two(Vec3f::Zero(), {0.2f, 0.01f, 0.01f}), {"gap"});
      ExpectRefused(two(0.05f * Vec3f::UnitZ(), {0.2f, 0.01f, 0.01f}), {"gap"});
      // One within the other.
      ExpectRefused(two(Vec3f::Zero(), kCube / 2), {"gap"});
      EXPECT_TRUE(two(0.1001f * along, kCube).ok());
      EXPECT_TRUE(two(0.1001f * across + 0.02f * along, kCube).ok());
    }
  }
  EXPECT_TRUE(
      Build({BoxOf(kFoam, Vec3f::Zero(), kCube), BoxOf(kClay, Vec3f(0.1f, 0, 0), kCube)}).ok())
      << "surfaces may";
}

TEST(Media, LeaveAGapToBalls) {
  auto balls = [](float distance) {
    return Build({}, {{Vec3f::Zero(), 0.05f, kFoam},
                      {distance * Vec3f(1, 2, 3).normalized(), 0.03f, kFoam}});
  };
  ExpectRefused(balls(0.0784f), {"ball 0 and ball 1 overlap or touch"});
  ExpectRefused(balls(0.08f), {"gap"});
  ExpectRefused(balls(0), {"gap"});
  EXPECT_TRUE(balls(0.0801f).ok());
  auto ball = [](const Vec3f& center, float radius) {
    return Build({BoxOf(kFoam, Vec3f::Zero(), kCube)}, {{center, radius, kGlass}});
  };
  ExpectRefused(ball({0.1f, 0.01f, 0.02f}, 0.05f), {"mesh 0", "ball 0", "gap"});
  ExpectRefused(ball(Vec3f::Constant(0.06f), 0.0175f), {"gap"});
  ExpectRefused(ball(Vec3f::Zero(), 0.03f), {"gap"});
  ExpectRefused(ball(Vec3f::Zero(), 0.2f), {"gap"});
  EXPECT_TRUE(ball({0.1f, 0.01f, 0.02f}, 0.0499f).ok());
  EXPECT_TRUE(ball(Vec3f::Constant(0.06f), 0.0172f).ok());
}

TEST(Media, LeaveAGapBetweenPlacesOfOneMesh) {
  auto at = [](float distance, float scale) {
    Mesh mesh = BoxOf(kFoam, Vec3f::Zero(), kCube);
    mesh.placements.resize(2, Eigen::Affine3f::Identity());
    mesh.placements[1].translate(Vec3f(distance, 0, 0)).scale(scale);
    return Build({mesh});
  };
  ExpectRefused(at(0.1f, 1), {"mesh 0 and mesh 0", "gap"});
  ExpectRefused(at(0.15f, 2), {"gap"});
  ExpectRefused(at(0, 0.5f), {"gap"});
  EXPECT_TRUE(at(0.1501f, 2).ok());
}

// Every part of a mesh counts, and a hollow is outside.
TEST(Media, AreSeenInEveryPartOfAMesh) {
  const Mesh hollow =
      Of(kFoam, {Box(Vec3f::Zero(), kCube), InsideOut(Box(Vec3f::Zero(), kCube / 2))});
  EXPECT_TRUE(Build({hollow}, {{Vec3f::Zero(), 0.02f, kFoam}}).ok());
  ExpectRefused(Build({hollow}, {{Vec3f(0, 0, 0.0375f), 0.01f, kFoam}}), {"gap"});
  const Mesh two = Of(kGlass, {Box(Vec3f(1, 0, 0), kCube), Box(Vec3f::Zero(), kCube / 4)});
  ExpectRefused(Build({BoxOf(kFoam, Vec3f::Zero(), kCube), two}), {"gap"});
  EXPECT_TRUE(Build({hollow, two}).ok());
}

TEST(Filled, GoOnceAroundWhatIsInside) {
  const Mesh cube = Box(Vec3f::Zero(), kCube);
  auto turned = [&](float by) {
    return Transformed(cube, Eigen::Affine3f(Eigen::AngleAxisf(by, Vec3f(1, 2, 3).normalized())));
  };
  for (int material : {kGlass, kFoam}) {
    auto build = [&](const std::vector<Mesh>& parts) { return Build({Of(material, parts)}); };
    ExpectRefused(build({cube, Box(Vec3f::Zero(), kCube / 2)}), {"mesh 0: it goes 2 times"});
    ExpectRefused(build({cube, cube}), {"mesh 0: it goes 2 times"});
    ExpectRefused(
        build({Box(Vec3f::Zero(), {0.2f, 0.05f, 0.05f}), Box(Vec3f::Zero(), {0.05f, 0.2f, 0.05f})}),
        {"mesh 0: it crosses or touches itself"});
    ExpectRefused(build({cube, Box(Vec3f(0.1f, 0.01f, 0), kCube)}), {"touches itself"});
    ExpectRefused(build({turned(0), turned(1)}), {"crosses"});
    ExpectRefused(build({cube, InsideOut(Box(Vec3f(0.2f, 0, 0), kCube / 2))}), {"0 times"});
    EXPECT_TRUE(build({cube, InsideOut(Box(Vec3f::Zero(), kCube / 2))}).ok()) << "hollow";
    EXPECT_TRUE(build({cube, Box(Vec3f(0.1001f, 0, 0), kCube)}).ok()) << "side by side";
    EXPECT_TRUE(build({Torus(Vec3f::Zero(), 0.1f, 0.03f)}).ok());
    ExpectRefused(build({Torus(Vec3f::Zero(), 0.1f, 0.11f)}), {"mesh 0: it "});
  }
  EXPECT_TRUE(Build({Of(kClay, {cube, cube})}).ok());
}

// Plates whose boxes along the axes all meet: few pairs of them are looked at.
TEST(Media, AreNotComparedAllWithAll) {
  constexpr size_t kPlates = 4000;
  std::vector<TurnedBox> plates;
  std::vector<Mesh> first;
  const float yaw = 0.6f;
  const Vec3f across(-std::sin(yaw), std::cos(yaw), 0);
  for (size_t i = 0; i < kPlates; ++i) {
    const Mesh plate = Box(75e-6f * static_cast<float>(i) * across, {0.2f, 12.5e-6f, 0.05f}, yaw);
    plates.push_back(BoxAround(plate.vertices));
    if (i < 400) first.push_back(Of(kFoam, {plate}));
  }
  EXPECT_TRUE(Build(first).ok());
  auto pairs = [&](double gap) {
    size_t count = 0;
    EXPECT_TRUE(CheckPairs(plates, gap, [&](size_t, size_t) {
                  ++count;
                  return absl::OkStatus();
                }).ok());
    return count;
  };
  EXPECT_LT(pairs(1e-5), kPlates);
  EXPECT_GE(pairs(60e-6), kPlates - 1) << "each and the next";
}

// In all positions: none that come near are left out, and a no ends it.
TEST(Separation, PairsThatComeNearAreChecked) {
  std::mt19937 random(2);
  std::uniform_real_distribution<float> part(-1, 1);
  auto place = [&] { return Vec3f(part(random), part(random), part(random)); };
  std::vector<TurnedBox> boxes;
  for (int i = 0; i < 100; ++i) {
    Eigen::Affine3f turn(
        Eigen::AngleAxisf(3.0f * part(random), (place() + Vec3f(0, 0, 2)).normalized()));
    turn.pretranslate(3 * place());
    boxes.push_back(BoxAround(Transformed(Box(Vec3f::Zero(), {1.2f, 0.7f, 0.4f}), turn).vertices));
  }
  std::set<std::pair<size_t, size_t>> checked;
  EXPECT_TRUE(CheckPairs(boxes, 1e-6, [&](size_t i, size_t j) {
                EXPECT_TRUE(checked.insert(std::minmax(i, j)).second) << "twice";
                return absl::OkStatus();
              }).ok());
  size_t near = 0;
  for (size_t j = 0; j < boxes.size(); ++j) {
    for (size_t i = 0; i < j; ++i) {
      if (AreApart(boxes[i], boxes[j], 1e-6)) continue;
      ++near;
      EXPECT_TRUE(checked.count({i, j}));
    }
  }
  EXPECT_GT(near, 50);
  EXPECT_LT(checked.size(), 100 * 99 / 2);
  int calls = 0;
  EXPECT_EQ(CheckPairs(boxes, 1e-6,
                       [&](size_t, size_t) {
                         ++calls;
                         return absl::AbortedError("no");
                       })
                .message(),
            "no");
  EXPECT_EQ(calls, 1);
}

// Boxes in all positions: separated by a plane are those whose triangles do not meet, unless one is within the other.
TEST(Separation, OfBoxesAgreesWithThatOfTheirTriangles) {
  std::mt19937 random(1);
  std::uniform_real_distribution<float> part(-1, 1);
  auto place = [&] { return Vec3f(part(random), part(random), part(random)); };
  int apart = 0;
  for (int i = 0; i < 1000; ++i) {
    std::vector<Mesh> boxes;
    for (float side : {-1.0f, 1.0f}) {
      Eigen::Affine3f turn(
          Eigen::AngleAxisf(3.0f * part(random), (place() + Vec3f(0, 0, 2)).normalized()));
      turn.pretranslate(Vec3f(side, 0, 0) + place() / 2);
      boxes.push_back(Transformed(Box(Vec3f::Zero(), {1.2f, 0.7f, 0.4f}), turn));
    }
    bool meet = false;
    for (const auto& s : boxes[0].triangles) {
      for (const auto& t : boxes[1].triangles) {
        Triangle a, b;
        for (int k = 0; k < 3; ++k) {
          a[k] = boxes[0].vertices[s[k]].cast<double>();
          b[k] = boxes[1].vertices[t[k]].cast<double>();
        }
        meet = meet || AreNear(a, b, 1e-6);
      }
    }
    const bool separate =
        AreApart(BoxAround(boxes[0].vertices), BoxAround(boxes[1].vertices), 1e-6);
    EXPECT_EQ(separate, !meet) << i;
    apart += separate;
  }
  EXPECT_GT(apart, 200);
  EXPECT_LT(apart, 800);
}

}  // namespace
}  // namespace lightstage::sim
