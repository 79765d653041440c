// For procedural scenes: puts shapes and materials into one description.
#pragma once

#include <utility>

#include "sim/render/scene.h"
#include "sim/render/shapes.h"

namespace lightstage::sim {

class Builder {
 public:
  int Add(Material material) {
    scene_.materials.push_back(std::move(material));
    return static_cast<int>(scene_.materials.size()) - 1;
  }
  int Matte(const Rgb& diffuse, Texture texture = {}) {
    return Add({.diffuse = diffuse, .texture = std::move(texture)});
  }
  int Plastic(const Rgb& diffuse, float roughness, Texture texture = {}) {
    return Add({.diffuse = diffuse,
                .specular = Rgb::Constant(0.05f),
                .roughness = roughness,
                .texture = std::move(texture)});
  }
  int Metal(const Rgb& specular, float roughness) {
    return Add({.specular = specular, .roughness = roughness});
  }
  int Mirror(float reflectance = 0.92f) {
    return Add({.kind = Material::Kind::kMirror, .specular = Rgb::Constant(reflectance)});
  }
  int Glass(float ior = 1.5f) { return Add({.kind = Material::Kind::kGlass, .ior = ior}); }
  // `free_path`: mean way between two scatterings, m.
  int Medium(float free_path, const Rgb& albedo, float anisotropy = 0) {
    return Add({.kind = Material::Kind::kMedium,
                .diffuse = albedo,
                .extinction = 1 / free_path,
                .anisotropy = anisotropy});
  }
  void Put(Mesh mesh, int material) {
    mesh.material = material;
    scene_.meshes.push_back(std::move(mesh));
  }
  void PutBall(const Vec3f& center, float radius, int material) {
    scene_.balls.push_back({center, radius, material});
  }
  SceneDescription Take() { return std::move(scene_); }

 private:
  SceneDescription scene_;
};

// The laboratory's dark floor, and the turntable: a disc of 48 cm whose top is z = 0, with a graduation of 64 azimuths.
void PutGround(Builder* b);

// Smooth bumps in [0,1] from a few fixed waves: enough to look like grain, and the same on every machine.
float Grain(float x, float y);

// Planks cut from one trunk, to be multiplied with white.
Rgb Wood(const SurfacePoint& at);

}  // namespace lightstage::sim
