#include "sim/scenes/scenes.h"

#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"

namespace lightstage::sim {
namespace {

TEST(Scenes, UnknownNameIsExplained) {
  auto scene = LoadScene("teapot", "");
  EXPECT_EQ(scene.status().code(), absl::StatusCode::kNotFound);
  EXPECT_NE(scene.status().message().find("default"), std::string::npos);
}

// Normals outward: seen from outside, every surface faces the viewer with its own side. A room's walls are seen from within.
TEST(Scenes, MeshesFaceOutward) {
  for (const ShippedScene& scene : ShippedScenes()) {
    auto description = LoadScene(scene.name, "");
    ASSERT_TRUE(description.ok());
    for (size_t i = 0; i < description->meshes.size(); ++i) {
      const Mesh& mesh = description->meshes[i];
      SCOPED_TRACE(absl::StrCat(scene.name, ", mesh ", i));
      if (mesh.triangles.size() == 2) continue;  // the floor
      double volume = 0;
      int against = 0;
      for (const auto& t : mesh.triangles) {
        const Vec3f &a = mesh.vertices[t[0]], &b = mesh.vertices[t[1]], &c = mesh.vertices[t[2]];
        volume += a.cross(b).dot(c) / 6;
        against += (b - a).cross(c - a).dot(mesh.normals[t[0]]) < 0;
      }
      EXPECT_GT(mesh.name == "walls" ? -volume : volume, 0);
      EXPECT_LT(against, static_cast<int>(mesh.triangles.size() / 50 + 1));
    }
  }
}

TEST(Scenes, CanBeBuiltAndStayModest) {
  for (const ShippedScene& shipped : ShippedScenes()) {
    auto description = LoadScene(shipped.name, "");
    ASSERT_TRUE(description.ok());
    size_t triangles = 0;
    for (const Mesh& mesh : description->meshes) triangles += mesh.triangles.size();
    EXPECT_LT(triangles, 600000u) << shipped.name;
    auto scene = Scene::Build(*std::move(description));
    EXPECT_TRUE(scene.ok()) << shipped.name << ": " << scene.status();
  }
}

}  // namespace
}  // namespace lightstage::sim
