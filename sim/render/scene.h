// What stands on the turntable: meshes and materials in the object frame (metres, +Z up, turntable's top at z = 0), and the
// acceleration structure that answers rays.
#pragma once

#include <embree3/rtcore.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <functional>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"

namespace lightstage::sim {

using Vec3f = Eigen::Vector3f;
using Rgb = Eigen::Array3f;

struct Material {
  enum class Kind {
    kSurface,  // Lambertian, with a GGX layer if `specular` is not 0 (bsdf.inc): matte, plastic, rough metal
    kMirror,  // reflects `specular` of the light, at every angle
    kGlass,   // smooth and clear, of refractive index `ior`, in a closed mesh; Fresnel's equations
  };
  Kind kind = Kind::kSurface;
  Rgb diffuse = Rgb::Zero();   // albedo, [0,1]
  Rgb specular = Rgb::Zero();  // reflectance at normal incidence, [0,1]
  float roughness = 1;         // GGX α, [0.01,1]
  float ior = 1.5f;            // [1,4]
  // Multiplies `diffuse` at a point of the object frame; none: 1.
  std::function<Rgb(const Vec3f&)> texture;
};

struct Mesh {
  std::vector<Vec3f> vertices;
  std::vector<Vec3f> normals;  // unit, outward, one per vertex; interpolated for shading
  std::vector<std::array<uint32_t, 3>> triangles;  // counterclockwise seen from outside
  int material = 0;
};

struct SceneDescription {
  std::vector<Material> materials;
  std::vector<Mesh> meshes;
};

// Built once, then only read: any number of threads may trace it. Movable.
class Scene {
 public:
  // INVALID_ARGUMENT / SCENE if an index is out of range; INTERNAL / EMBREE if Embree refuses.
  static absl::StatusOr<Scene> Build(SceneDescription description);
  Scene(Scene&& other) noexcept;
  Scene& operator=(Scene&&) = delete;
  ~Scene();

  RTCScene handle() const { return scene_; }

  // What a ray meets first.
  struct Hit {
    Vec3f point;   // on the surface
    Vec3f face;    // unit normal of the triangle, towards the ray's origin
    Vec3f normal;  // unit shading normal, on the same side
    Rgb diffuse;   // texture applied
    const Material* material;
    bool outside;  // the ray comes from the outer side of the mesh
  };
  // What Embree found, where. `direction`: the ray's, of any length.
  Hit Resolve(uint32_t mesh, uint32_t triangle, float u, float v, const Vec3f& direction) const;

 private:
  Scene() = default;
  SceneDescription description_;
  RTCDevice device_ = nullptr;
  RTCScene scene_ = nullptr;
};

}  // namespace lightstage::sim
