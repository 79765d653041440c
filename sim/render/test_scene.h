// What the renderer's tests share.
#pragma once

#include <gtest/gtest.h>

#include <utility>
#include <vector>

#include "optics/image.h"
#include "sim/render/scene.h"

namespace lightstage::sim {

inline Scene BuildScene(std::vector<Mesh> meshes, std::vector<Material> materials) {
  auto scene = Scene::Build({std::move(materials), std::move(meshes)});
  EXPECT_TRUE(scene.ok()) << scene.status();
  return *std::move(scene);
}

// Of all pixels and channels.
inline double Mean(const Image& image) {
  double sum = 0;
  for (float v : image.pixels()) sum += v;
  return sum / static_cast<double>(image.pixels().size());
}

}  // namespace lightstage::sim
