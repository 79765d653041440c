#include "sim/render/scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "absl/strings/str_cat.h"
#include "base/status.h"
#include "sim/render/check_filled.h"
#include "sim/render/check_scene.h"
#include "sim/render/kernels.h"
#include "sim/render/triangles.h"
#include "sim/render/winding.h"

namespace lightstage::sim {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;

// A shadow ray goes on through the boundary of a medium, and remembers how much of it lies in between: entering counts from the
// far end, leaving to it.
void PassMedium(const RTCFilterFunctionNArguments* args) {
  const auto* material = static_cast<const Material*>(args->geometryUserPtr);
  auto* shadow = reinterpret_cast<ShadowContext*>(args->context);
  for (unsigned int i = 0; i < args->N; ++i) {
    if (args->valid[i] == 0) continue;
    const float leaving =
        RTCHitN_Ng_x(args->hit, args->N, i) * RTCRayN_dir_x(args->ray, args->N, i) +
        RTCHitN_Ng_y(args->hit, args->N, i) * RTCRayN_dir_y(args->ray, args->N, i) +
        RTCHitN_Ng_z(args->hit, args->N, i) * RTCRayN_dir_z(args->ray, args->N, i);
    const float depth = material->extinction * RTCRayN_tfar(args->ray, args->N, i);
    shadow->optical_depth[RTCRayN_id(args->ray, args->N, i)] += leaving > 0 ? depth : -depth;
    args->valid[i] = 0;
  }
}

RTCGeometry MakeBall(RTCDevice device, const Ball& ball) {
  RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_SPHERE_POINT);
  auto* point = static_cast<float*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT4, 4 * sizeof(float), 1));
  if (point != nullptr) {
    for (int c = 0; c < 3; ++c) point[c] = ball.center[c];
    point[3] = ball.radius;
  }
  return geometry;
}

void SetMaterial(RTCGeometry geometry, const Material& material) {
  if (material.kind != Material::Kind::kMedium) return;
  rtcSetGeometryUserData(geometry, const_cast<Material*>(&material));  // only read
  rtcSetGeometryOccludedFilterFunction(geometry, &PassMedium);
}

void CommitTo(RTCScene scene, RTCGeometry geometry) {
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(scene, geometry);  // numbers count up from 0
  rtcReleaseGeometry(geometry);
}

// The triangle that a ray has met, in the scene's frame; returns the texture's place.
Vec2f SetTriangle(const Mesh& mesh, const Eigen::Affine3f* placement, const RTCRayHit8& rays,
                  int lane, TrianglePacket* out) {
  const auto& t = mesh.triangles[rays.hit.primID[lane]];
  const std::array<Lanes*, 3> corners = {out->a, out->b, out->c},
                              normals = {out->na, out->nb, out->nc};
  for (int i = 0; i < 3; ++i) {
    Vec3f corner = mesh.vertices[t[i]], normal = mesh.normals[t[i]];
    if (placement != nullptr) {
      // A similarity: normals turn as directions do.
      corner = *placement * corner;
      normal = placement->linear() * normal;
    }
    Put(corner, lane, &corners[i][0], &corners[i][1], &corners[i][2]);
    Put(normal, lane, &normals[i][0], &normals[i][1], &normals[i][2]);
  }
  if (mesh.uvs.empty()) return Vec2f::Zero();
  const float u = rays.hit.u[lane], v = rays.hit.v[lane];
  return (1 - u - v) * mesh.uvs[t[0]] + u * mesh.uvs[t[1]] + v * mesh.uvs[t[2]];
}

// Near the edge Embree's single precision may put the point on the wrong side of it. Returns the outward normal.
Vec3f SetBall(const Ball& ball, const RTCRayHit8& rays, int lane, SurfacePacket* out) {
  using Vec3d = Eigen::Vector3d;
  const RTCRay8& ray = rays.ray;
  const Vec3d direction = Vec3d(ray.dir_x[lane], ray.dir_y[lane], ray.dir_z[lane]).normalized(),
              from = Vec3d(ray.org_x[lane], ray.org_y[lane], ray.org_z[lane]) -
                     ball.center.cast<double>();
  const double middle = -from.dot(direction);  // where the ray is nearest to the centre
  const double off = from.squaredNorm() - middle * middle;
  const double half = std::sqrt(std::max(0.0, double{ball.radius} * ball.radius - off));
  const bool outside = ray.tfar[lane] < middle;
  Vec3f outward =
      (from + (outside ? middle - half : middle + half) * direction).normalized().cast<float>();
  const float side = outside ? 1.0f : -1.0f;
  const Vec3f point = ball.center + ball.radius * outward, normal = side * outward;
  Put(point, lane, &out->x, &out->y, &out->z);
  Put(normal, lane, &out->fx, &out->fy, &out->fz);
  Put(normal, lane, &out->nx, &out->ny, &out->nz);
  out->side.v[lane] = side;
  return outward;
}

Vec2f BallUv(const Vec3f& outward) {
  return {std::atan2(outward.y(), outward.x()) / (2 * kPi) + 0.5f,
          std::acos(std::clamp(-outward.z(), -1.0f, 1.0f)) / kPi};
}

// The material at the point that is set; returns the texture there.
Rgb SetColors(const Material& material, const Vec2f& uv, int lane, SurfacePacket* out) {
  Rgb tint = Rgb::Ones(), diffuse = material.diffuse, specular = material.specular;
  if (material.texture) {
    tint = material.texture({Vec3f(out->x.v[lane], out->y.v[lane], out->z.v[lane]), uv});
    ((diffuse > 0).any() ? diffuse : specular) *= tint;
  }
  Put(diffuse, lane, &out->dr, &out->dg, &out->db);
  Put(specular, lane, &out->sr, &out->sg, &out->sb);
  out->roughness.v[lane] = material.roughness;
  return tint;
}

}  // namespace

absl::StatusOr<Scene> Scene::Build(SceneDescription description) {
  RETURN_IF_ERROR(CheckScene(description));
  Scene scene;
  scene.description_ = std::make_unique<SceneDescription>(std::move(description));
  // Building takes a tenth of a second on one thread, and what comes out does not depend on how many there are.
  scene.device_ = rtcNewDevice("threads=1");
  if (scene.device_ == nullptr) {
    return Error(absl::StatusCode::kInternal, "EMBREE",
                 "Embree gives no device: for want of memory or threads");
  }
  scene.scene_ = rtcNewScene(scene.device_);
  // Rays must not slip through where thin triangles meet.
  rtcSetSceneFlags(scene.scene_, RTC_SCENE_FLAG_ROBUST);
  RETURN_IF_ERROR(CheckFilled(*scene.description_, scene.device_));
  scene.Attach();
  rtcCommitScene(scene.scene_);
  if (RTCError error = rtcGetDeviceError(scene.device_); error != RTC_ERROR_NONE) {
    return Error(absl::StatusCode::kInternal, "EMBREE",
                 absl::StrCat("Embree cannot build the scene: error ", static_cast<int>(error)),
                 {{"error", absl::StrCat(static_cast<int>(error))}});
  }
  return scene;
}

void Scene::Attach() {
  for (size_t i = 0; i < description_->meshes.size(); ++i) {
    const Mesh& mesh = description_->meshes[i];
    RTCGeometry triangles = MakeTriangles(device_, mesh);
    const Material& material = description_->materials[mesh.material];
    SetMaterial(triangles, material);
    Geometry as_it_is{.mesh = &mesh, .number = static_cast<int>(i), .material = &material};
    if (mesh.placements.empty()) {
      CommitTo(scene_, triangles);
      for (const Vec3f& v : mesh.vertices) as_it_is.box.extend(v);
      geometries_.push_back(as_it_is);
      continue;
    }
    RTCScene once = rtcNewScene(device_);
    rtcSetSceneFlags(once, RTC_SCENE_FLAG_ROBUST);
    CommitTo(once, triangles);
    rtcCommitScene(once);
    for (const Eigen::Affine3f& placement : mesh.placements) {
      RTCGeometry instance = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_INSTANCE);
      rtcSetGeometryInstancedScene(instance, once);
      rtcSetGeometryTransform(instance, 0, RTC_FORMAT_FLOAT4X4_COLUMN_MAJOR,
                              placement.matrix().data());
      CommitTo(scene_, instance);
      Geometry& placed = geometries_.emplace_back(as_it_is);
      placed.placement = &placement;
      for (const Vec3f& v : mesh.vertices) placed.box.extend(placement * v);
    }
    rtcReleaseScene(once);  // the instances hold it
  }
  for (size_t i = 0; i < description_->balls.size(); ++i) {
    const Ball& ball = description_->balls[i];
    const Material& material = description_->materials[ball.material];
    RTCGeometry geometry = MakeBall(device_, ball);
    SetMaterial(geometry, material);
    CommitTo(scene_, geometry);
    Geometry& round = geometries_.emplace_back();
    round = {.ball = &ball, .number = static_cast<int>(i), .material = &material};
    for (float side : {-1.0f, 1.0f})
      round.box.extend(ball.center + side * ball.radius * Vec3f::Ones());
  }
}

Scene::Scene(Scene&& other) noexcept
    : description_(std::move(other.description_)),
      geometries_(std::move(other.geometries_)),
      device_(std::exchange(other.device_, nullptr)),
      scene_(std::exchange(other.scene_, nullptr)) {}

Scene::~Scene() {
  if (scene_ != nullptr) rtcReleaseScene(scene_);
  if (device_ != nullptr) rtcReleaseDevice(device_);
}

void Scene::Resolve(const RTCRayHit8& rays, Hits* hits) const {
  const Geometry* geometries[kLanes];
  Vec2f uvs[kLanes];
  for (int k = 0; k < kLanes; ++k) {
    geometries[k] = GeometryOf(rays, k);
    if (geometries[k] == nullptr || geometries[k]->mesh == nullptr) continue;
    uvs[k] = SetTriangle(*geometries[k]->mesh, geometries[k]->placement, rays, k, &hits->triangles);
  }
  SurfacePacket& surface = hits->surface;
  BestKernels().triangles(rays, hits->triangles, &surface);
  for (int k = 0; k < kLanes; ++k) {
    hits->materials[k] = nullptr;
    if (geometries[k] == nullptr) continue;
    const Material& material = *geometries[k]->material;
    if (geometries[k]->ball != nullptr) {
      const Vec3f outward = SetBall(*geometries[k]->ball, rays, k, &surface);
      if (material.texture) uvs[k] = BallUv(outward);
    }
    hits->materials[k] = &material;
    hits->tints[k] = SetColors(material, uvs[k], k, &surface);
  }
}

std::string Scene::NameOf(const Geometry& geometry) const {
  if (geometry.ball != nullptr) return absl::StrCat("ball ", geometry.number);
  return sim::NameOf(*geometry.mesh, geometry.number);
}

bool Scene::Encloses(const Geometry& geometry, const Vec3f& point) const {
  if (const Ball* ball = geometry.ball; ball != nullptr) {
    return (point - ball->center).norm() < ball->radius;
  }
  if (!geometry.box.contains(point)) return false;
  const Vec3f own =
      geometry.placement != nullptr ? Vec3f(geometry.placement->inverse() * point) : point;
  return WindingNumber(*geometry.mesh, own.cast<double>()) > 0.5;
}

absl::Status Scene::CheckOutside(const Vec3f& point, const std::string& what) const {
  for (const Geometry& geometry : geometries_) {
    if (!Encloses(geometry, point)) continue;
    const std::string name = NameOf(geometry);
    return Error(absl::StatusCode::kFailedPrecondition, "INSIDE_OBJECT",
                 absl::StrCat(what, " at (", point.x(), ", ", point.y(), ", ", point.z(),
                              ") m stands inside of ", name, ": move it or the object"),
                 {{"shape", name}});
  }
  return absl::OkStatus();
}

}  // namespace lightstage::sim
