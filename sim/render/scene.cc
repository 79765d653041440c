#include "sim/render/scene.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "absl/strings/str_cat.h"
#include "base/status.h"
#include "sim/render/check_scene.h"
#include "sim/render/kernels.h"
#include "sim/render/triangles.h"

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
    const float leaving = RTCHitN_Ng_x(args->hit, args->N, i) * RTCRayN_dir_x(args->ray, args->N, i) +
                          RTCHitN_Ng_y(args->hit, args->N, i) * RTCRayN_dir_y(args->ray, args->N, i) +
                          RTCHitN_Ng_z(args->hit, args->N, i) * RTCRayN_dir_z(args->ray, args->N, i);
    const float depth = material->extinction * RTCRayN_tfar(args->ray, args->N, i);
    shadow->optical_depth[RTCRayN_id(args->ray, args->N, i)] += leaving > 0 ? depth : -depth;
    args->valid[i] = 0;
  }
}

RTCGeometry MakeBall(RTCDevice device, const Ball& ball) {
  RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_SPHERE_POINT);
  auto* point = static_cast<float*>(
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT4, 4 * sizeof(float), 1));
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

}  // namespace

absl::StatusOr<Scene> Scene::Build(SceneDescription description) {
  RETURN_IF_ERROR(CheckScene(description));
  Scene scene;
  scene.description_ = std::make_unique<SceneDescription>(std::move(description));
  // Building takes a tenth of a second on one thread, and what comes out does not depend on how many there are.
  scene.device_ = rtcNewDevice("threads=1");
  if (scene.device_ == nullptr) {
    return Error(absl::StatusCode::kInternal, "EMBREE", "Embree gives no device");
  }
  scene.scene_ = rtcNewScene(scene.device_);
  // Rays must not slip through where thin triangles meet.
  rtcSetSceneFlags(scene.scene_, RTC_SCENE_FLAG_ROBUST);
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
    SetMaterial(triangles, description_->materials[mesh.material]);
    if (mesh.placements.empty()) {
      CommitTo(scene_, triangles);
      geometries_.push_back({.mesh = static_cast<int>(i)});
      continue;
    }
    RTCScene once = rtcNewScene(device_);
    rtcSetSceneFlags(once, RTC_SCENE_FLAG_ROBUST);
    CommitTo(once, triangles);
    rtcCommitScene(once);
    for (const Eigen::Affine3f& placement : mesh.placements) {
      RTCGeometry instance = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_INSTANCE);
      rtcSetGeometryInstancedScene(instance, once);
      rtcSetGeometryTransform(instance, 0, RTC_FORMAT_FLOAT4X4_COLUMN_MAJOR, placement.matrix().data());
      CommitTo(scene_, instance);
      geometries_.push_back({.mesh = static_cast<int>(i), .placement = placement, .placed = true});
    }
    rtcReleaseScene(once);  // the instances hold it
  }
  for (size_t i = 0; i < description_->balls.size(); ++i) {
    RTCGeometry geometry = MakeBall(device_, description_->balls[i]);
    SetMaterial(geometry, description_->materials[description_->balls[i].material]);
    CommitTo(scene_, geometry);
    geometries_.push_back({.ball = static_cast<int>(i)});
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

Scene::Hit Scene::Resolve(uint32_t instance, uint32_t geometry_index, uint32_t triangle, float u, float v,
                          const Vec3f& point, const Vec3f& direction) const {
  const Geometry& geometry =
      geometries_[instance != RTC_INVALID_GEOMETRY_ID ? instance : geometry_index];
  Hit hit;
  SurfacePoint at;
  int material;
  if (geometry.ball >= 0) {
    const Ball& ball = description_->balls[geometry.ball];
    hit.normal = hit.face = (point - ball.center).normalized();
    hit.point = ball.center + ball.radius * hit.normal;
    at.uv = Vec2f(std::atan2(hit.normal.y(), hit.normal.x()) / (2 * kPi) + 0.5f,
                  std::acos(std::clamp(-hit.normal.z(), -1.0f, 1.0f)) / kPi);
    material = ball.material;
  } else {
    const Mesh& mesh = description_->meshes[geometry.mesh];
    const auto& t = mesh.triangles[triangle];
    const float w = 1 - u - v;
    const Vec3f &a = mesh.vertices[t[0]], &b = mesh.vertices[t[1]], &c = mesh.vertices[t[2]];
    hit.point = w * a + u * b + v * c;
    hit.face = (b - a).cross(c - a);
    hit.normal = w * mesh.normals[t[0]] + u * mesh.normals[t[1]] + v * mesh.normals[t[2]];
    if (!mesh.uvs.empty()) at.uv = w * mesh.uvs[t[0]] + u * mesh.uvs[t[1]] + v * mesh.uvs[t[2]];
    if (geometry.placed) {
      // A similarity: normals turn as directions do.
      hit.point = geometry.placement * hit.point;
      hit.face = geometry.placement.linear() * hit.face;
      hit.normal = geometry.placement.linear() * hit.normal;
    }
    hit.face.normalize();
    hit.normal.normalize();
    material = mesh.material;
  }
  hit.outside = hit.face.dot(direction) <= 0;
  if (!hit.outside) {
    hit.face = -hit.face;
    hit.normal = -hit.normal;
  }
  at.position = hit.point;
  hit.material = &description_->materials[material];
  hit.tint = hit.material->texture ? hit.material->texture(at) : Rgb::Ones();
  const bool colored = (hit.material->diffuse > 0).any();
  hit.diffuse = hit.material->diffuse * hit.tint;
  hit.specular = colored ? hit.material->specular : hit.material->specular * hit.tint;
  return hit;
}

std::string Scene::NameOf(const Geometry& geometry) const {
  if (geometry.ball >= 0) return absl::StrCat("ball ", geometry.ball);
  const std::string& name = description_->meshes[geometry.mesh].name;
  return name.empty() ? absl::StrCat("mesh ", geometry.mesh) : name;
}

absl::Status Scene::CheckOutside(const Vec3f& point, const std::string& what) const {
  // A ray from within leaves more closed shapes than it enters. Three rays must agree: one may slip through a hole or along an edge.
  const Vec3f directions[] = {
      {0.2672f, 0.5345f, 0.8018f}, {-0.8729f, 0.4364f, 0.2182f}, {0.1231f, -0.8616f, 0.4924f}};
  std::string name;
  for (const Vec3f& direction : directions) {
    int left = 0;
    std::string nearest;
    Vec3f origin = point;
    constexpr int kMostSurfaces = 1000;
    for (int i = 0; i < kMostSurfaces; ++i) {
      RTCIntersectContext context;
      rtcInitIntersectContext(&context);
      RTCRayHit ray;
      ray.ray = {};
      ray.ray.org_x = origin.x();
      ray.ray.org_y = origin.y();
      ray.ray.org_z = origin.z();
      ray.ray.dir_x = direction.x();
      ray.ray.dir_y = direction.y();
      ray.ray.dir_z = direction.z();
      ray.ray.tfar = std::numeric_limits<float>::infinity();
      ray.ray.mask = ~0u;
      ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
      ray.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
      rtcIntersect1(scene_, &context, &ray);
      if (ray.hit.geomID == RTC_INVALID_GEOMETRY_ID) break;
      const Vec3f there = origin + ray.ray.tfar * direction;
      const Hit hit = Resolve(ray.hit.instID[0], ray.hit.geomID, ray.hit.primID, ray.hit.u, ray.hit.v, there,
                              direction);
      left += hit.outside ? -1 : 1;
      if (left > 0 && nearest.empty()) {
        nearest = NameOf(
            geometries_[ray.hit.instID[0] != RTC_INVALID_GEOMETRY_ID ? ray.hit.instID[0] : ray.hit.geomID]);
      }
      origin = there + 1e-5f * direction;
    }
    if (left <= 0) return absl::OkStatus();
    name = nearest;
  }
  return Error(absl::StatusCode::kFailedPrecondition, "INSIDE_OBJECT",
               absl::StrCat(what, " at (", point.x(), ", ", point.y(), ", ", point.z(),
                            ") m stands inside of ", name, ": move it or the object"),
               {{"shape", name}});
}

}  // namespace lightstage::sim
