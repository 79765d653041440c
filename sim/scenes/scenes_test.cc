#include "sim/scenes/scenes.h"

#include <gtest/gtest.h>

namespace lightstage::sim {
namespace {

TEST(Scenes, UnknownNameIsExplained) {
  auto scene = LoadScene("teapot", "");
  EXPECT_EQ(scene.status().code(), absl::StatusCode::kNotFound);
  EXPECT_NE(scene.status().message().find("default"), std::string::npos);
}

// Closed meshes, normals outward: seen from outside, every surface faces the viewer with its own side.
TEST(Scenes, MeshesFaceOutward) {
  auto description = LoadScene("default", "");
  ASSERT_TRUE(description.ok());
  for (const Mesh& mesh : description->meshes) {
    if (mesh.triangles.size() == 2) continue;  // the floor
    double volume = 0;
    int against = 0;
    for (const auto& t : mesh.triangles) {
      const Vec3f &a = mesh.vertices[t[0]], &b = mesh.vertices[t[1]], &c = mesh.vertices[t[2]];
      volume += a.cross(b).dot(c) / 6;
      against += (b - a).cross(c - a).dot(mesh.normals[t[0]]) < 0;
    }
    EXPECT_GT(volume, 0);
    EXPECT_LT(against, static_cast<int>(mesh.triangles.size() / 50 + 1));
  }
}

}  // namespace
}  // namespace lightstage::sim
