// What stands on the turntable: shapes and materials in the object frame (metres, +Z up, turntable's top at z = 0), and the
// acceleration structure that answers rays.
#pragma once

#include <embree3/rtcore.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "sim/render/kernels.h"

namespace lightstage::sim {

using Vec3f = Eigen::Vector3f;
using Vec2f = Eigen::Vector2f;
using Rgb = Eigen::Array3f;

// Three numbers into a lane of a packet.
template <class Three>
void Put(const Three& from, uint32_t lane, Lanes* x, Lanes* y, Lanes* z) {
  x->v[lane] = from[0];
  y->v[lane] = from[1];
  z->v[lane] = from[2];
}

// Where a texture is looked up.
struct SurfacePoint {
  Vec3f position;  // object frame
  Vec2f uv = Vec2f::
      Zero();  // the mesh's own; a ball's: azimuth and height, each [0,1]; (0, 0) where there is none
};

// A colour in [0,1] by place; none: white.
class Texture {
 public:
  Texture() = default;
  template <class F>
  requires(!std::is_same_v<F, Texture>) Texture(F lookup)
      : lookup_(std::move(lookup)) {  // NOLINT: a lambda is one
    static_assert(
        std::is_same_v<std::invoke_result_t<F, const SurfacePoint&>, Rgb>,
        "must return Rgb itself (-> Rgb): an Eigen expression would refer to what is gone");
  }
  explicit operator bool() const { return lookup_ != nullptr; }
  Rgb operator()(const SurfacePoint& at) const { return lookup_(at); }

 private:
  std::function<Rgb(const SurfacePoint&)> lookup_;
};

struct Material {
  enum class Kind {
    kSurface,  // Lambertian, with a GGX layer if `specular` is not 0 (bsdf.inc): matte, plastic, rough metal
    kMirror,  // reflects `specular` of the light, at every angle
    kGlass,   // smooth and clear, of refractive index `ior`, in a closed shape; Fresnel's equations
    kMedium,  // fills a closed shape with what scatters light, index-matched: its boundary itself does nothing. Media must not overlap or
              // touch each other or glass; surfaces may stand in them.
  };
  // Light goes on within: its shape must be closed.
  bool has_inside() const { return kind == Kind::kGlass || kind == Kind::kMedium; }
  Kind kind = Kind::kSurface;
  Rgb diffuse = Rgb::Zero();   // albedo, [0,1]; of a medium: scattering over extinction
  Rgb specular = Rgb::Zero();  // reflectance at normal incidence, [0,1]
  float roughness = 1;         // GGX α, [0.01,1]
  float ior = 1.5f;            // [1,4]
  float extinction = 0;        // of a medium, 1/m: the inverse of its mean free path
  float anisotropy =
      0;  // of a medium: mean cosine of the scattering angle (Henyey-Greenstein), (−1,1)
  // Multiplies the colour: `diffuse` and, if that is black or there is none, `specular`; what glass lets through.
  Texture texture;
};

struct Mesh {
  std::string name;  // for errors
  std::vector<Vec3f> vertices;
  std::vector<Vec3f> normals;  // unit, outward, one per vertex; interpolated for shading
  std::vector<Vec2f> uvs;      // one per vertex, or none
  std::vector<std::array<uint32_t, 3>> triangles;  // counterclockwise seen from outside
  int material = 0;
  // Where it stands, as instances of one structure in memory; none: once, as it is. Similarities only (rotation, translation, one
  // positive scale for all axes).
  std::vector<Eigen::Affine3f> placements;
};

// A perfect sphere.
struct Ball {
  Vec3f center = Vec3f::Zero();
  float radius = 0;
  int material = 0;
};

struct SceneDescription {
  std::vector<Material> materials;
  std::vector<Mesh> meshes;
  std::vector<Ball> balls;
};

// Built once, then only read: any number of threads may trace it. Movable.
class Scene {
 public:
  // INVALID_ARGUMENT / SCENE, naming the shape and its element: an index out of range, a number that is none, a triangle without
  // an area; glass or a medium in a mesh that is not closed, or that touches itself or goes round a place more than once; a medium that
  // overlaps or touches another one or glass. INTERNAL / EMBREE if Embree refuses.
  static absl::StatusOr<Scene> Build(SceneDescription description);
  Scene(Scene&& other) noexcept;
  Scene& operator=(Scene&&) = delete;
  ~Scene();

  // Occlusion is to be asked with a ShadowContext (kernels.h), or media hide what is behind them.
  RTCScene handle() const { return scene_; }

  // What eight rays have met first.
  struct Hits {
    TrianglePacket triangles = {};
    SurfacePacket surface = {};  // textures applied
    Rgb tints[kLanes];           // the textures
    // Null where a ray has met nothing: the rest is as it was before there.
    const Material* materials[kLanes] = {};
  };
  // `rays`: of unit directions, as rtcIntersect8 leaves them.
  void Resolve(const RTCRayHit8& rays, Hits* hits) const;

  // FAILED_PRECONDITION / INSIDE_OBJECT naming the shape, if `what` stands at a point inside a closed one: it would see it from
  // within.
  absl::Status CheckOutside(const Vec3f& point, const std::string& what) const;

 private:
  // What an Embree geometry is.
  struct Geometry {
    const Mesh* mesh = nullptr;  // one of them
    const Ball* ball = nullptr;
    int number = 0;  // among the meshes or balls
    const Material* material = nullptr;
    const Eigen::Affine3f* placement = nullptr;  // null: as it is
    Eigen::AlignedBox3f box;                     // of the mesh as it is placed
  };

  Scene() = default;
  void Attach();
  const Geometry* GeometryOf(const RTCRayHit8& rays, int lane) const {
    const uint32_t instance = rays.hit.instID[0][lane], geometry = rays.hit.geomID[lane];
    if (geometry == RTC_INVALID_GEOMETRY_ID) return nullptr;
    return &geometries_[instance != RTC_INVALID_GEOMETRY_ID ? instance : geometry];
  }
  bool Encloses(const Geometry& geometry, const Vec3f& point) const;
  std::string NameOf(const Geometry& geometry) const;

  std::unique_ptr<SceneDescription> description_;  // in one place: Embree points into it
  std::vector<Geometry> geometries_;               // by Embree's number
  RTCDevice device_ = nullptr;
  RTCScene scene_ = nullptr;
};

}  // namespace lightstage::sim
