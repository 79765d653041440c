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

// Lambert plus, if `specular` is not 0, a GGX lobe with Schlick's Fresnel term; the diffuse part loses what Fresnel reflects.
struct Material {
  Rgb diffuse = Rgb::Zero();   // albedo, [0,1]
  Rgb specular = Rgb::Zero();  // reflectance at normal incidence, [0,1]
  float roughness = 1;         // GGX α, (0,1]
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
  };
  // False if the ray leaves the scene. `direction` need not be unit.
  bool Intersect(const Vec3f& origin, const Vec3f& direction, Hit* hit) const;

 private:
  Scene() = default;
  SceneDescription description_;
  RTCDevice device_ = nullptr;
  RTCScene scene_ = nullptr;
};

}  // namespace lightstage::sim
