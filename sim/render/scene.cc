#include "sim/render/scene.h"

#include <algorithm>
#include <cmath>
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
    const float leaving =
        RTCHitN_Ng_x(args->hit, args->N, i) * RTCRayN_dir_x(args->ray, args->N, i) +
        RTCHitN_Ng_y(args->hit, args->N, i) * RTCRayN_dir_y(args->ray, args->N, i) +
        RTCHitN_Ng_z(args->hit, args->N, i) * RTCRayN_dir_z(args->ray, args->N, i);
    const float depth = material->extinction * RTCRayN_tfar(args->ray, args->N, i);
    shadow->optical_depth[RTCRayN_id(args->ray, args->N, i)] += leaving > 0 ? depth : -depth;
    args->valid[i] = 0;
  }
}

// How often the mesh goes around a point: 1 within a closed mesh, 0 outside of it, −1 in a room whose walls face inwards, something in
// between near an open one (Jacobson, Kavan, Sorkine-Hornung, "Robust Inside-Outside Segmentation using Generalized Winding Numbers",
// 2013). The solid angles of the triangles after van Oosterom and Strackee, 1983.
double WindingNumber(const Mesh& mesh, const Eigen::Vector3d& point) {
  double sum = 0;
  for (const auto& t : mesh.triangles) {
    const Eigen::Vector3d a = mesh.vertices[t[0]].cast<double>() - point,
                          b = mesh.vertices[t[1]].cast<double>() - point,
                          c = mesh.vertices[t[2]].cast<double>() - point;
    const double la = a.norm(), lb = b.norm(), lc = c.norm();
    sum += 2 * std::atan2(a.dot(b.cross(c)),
                          la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
  }
  return sum / (4 * std::numbers::pi);
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
      rtcSetGeometryTransform(instance, 0, RTC_FORMAT_FLOAT4X4_COLUMN_MAJOR,
                              placement.matrix().data());
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
  for (Geometry& geometry : geometries_) {
    if (geometry.mesh < 0) continue;
    for (const Vec3f& v : description_->meshes[geometry.mesh].vertices) {
      geometry.box.extend(geometry.placed ? Vec3f(geometry.placement * v) : v);
    }
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

// Near the edge Embree's single precision may put the point on the wrong side of it.
void Scene::ResolveBall(const Ball& ball, const Ray& ray, float distance, Hit* hit) const {
  const Eigen::Vector3d direction = ray.direction.cast<double>().normalized(),
                        from = (ray.origin - ball.center).cast<double>();
  const double middle = -from.dot(direction);  // where the ray is nearest to the centre
  const double off = from.squaredNorm() - middle * middle;
  const double half = std::sqrt(std::max(0.0, double{ball.radius} * ball.radius - off));
  hit->outside = distance < middle;
  const double there = hit->outside ? middle - half : middle + half;
  const Eigen::Vector3d normal = (from + there * direction).normalized();
  hit->point = ball.center + ball.radius * normal.cast<float>();
  hit->face = hit->normal = (hit->outside ? normal : -normal).cast<float>();
}

Scene::Hit Scene::Resolve(const Ray& ray, const Found& found) const {
  const Geometry& geometry = GeometryOf(found);
  Hit hit;
  SurfacePoint at;
  int material;
  if (geometry.ball >= 0) {
    const Ball& ball = description_->balls[geometry.ball];
    ResolveBall(ball, ray, found.distance, &hit);
    const Vec3f outward = hit.outside ? hit.normal : Vec3f(-hit.normal);
    at.uv = Vec2f(std::atan2(outward.y(), outward.x()) / (2 * kPi) + 0.5f,
                  std::acos(std::clamp(-outward.z(), -1.0f, 1.0f)) / kPi);
    material = ball.material;
  } else {
    const Mesh& mesh = description_->meshes[geometry.mesh];
    const auto& t = mesh.triangles[found.triangle];
    const float u = found.u, v = found.v, w = 1 - u - v;
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
    hit.outside = hit.face.dot(ray.direction) <= 0;
    if (!hit.outside) {
      hit.face = -hit.face;
      hit.normal = -hit.normal;
    }
    material = mesh.material;
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

bool Scene::Encloses(const Geometry& geometry, const Vec3f& point) const {
  if (geometry.ball >= 0) {
    const Ball& ball = description_->balls[geometry.ball];
    return (point - ball.center).norm() < ball.radius;
  }
  if (!geometry.box.contains(point)) return false;
  const Mesh& mesh = description_->meshes[geometry.mesh];
  const Vec3f own = geometry.placed ? Vec3f(geometry.placement.inverse() * point) : point;
  return WindingNumber(mesh, own.cast<double>()) > 0.5;
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
