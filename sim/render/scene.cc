#include "sim/render/scene.h"

#include <cstring>
#include <utility>

#include "absl/strings/str_cat.h"
#include "base/status.h"

namespace lightstage::sim {
namespace {

absl::Status CheckDescription(const SceneDescription& description) {
  for (size_t m = 0; m < description.meshes.size(); ++m) {
    const Mesh& mesh = description.meshes[m];
    const int materials = static_cast<int>(description.materials.size());
    bool good = mesh.material >= 0 && mesh.material < materials &&
                mesh.normals.size() == mesh.vertices.size();
    for (const auto& triangle : mesh.triangles) {
      for (uint32_t v : triangle) good = good && v < mesh.vertices.size();
    }
    if (!good) {
      return Error(absl::StatusCode::kInvalidArgument, "SCENE",
                   absl::StrCat("mesh ", m,
                                " names a vertex, normal or material that the scene does not have"),
                   {{"mesh", absl::StrCat(m)}});
    }
  }
  return absl::OkStatus();
}

void AttachMesh(RTCDevice device, RTCScene scene, const Mesh& mesh) {
  RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  static_assert(sizeof(Vec3f) == 3 * sizeof(float));
  // Embree owns its copies: it wants padding behind the last element.
  void* vertices = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                           sizeof(Vec3f), mesh.vertices.size());
  void* indices = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                          3 * sizeof(uint32_t), mesh.triangles.size());
  if (vertices != nullptr && indices != nullptr) {
    std::memcpy(vertices, mesh.vertices.data()->data(), mesh.vertices.size() * sizeof(Vec3f));
    std::memcpy(indices, mesh.triangles.data(), mesh.triangles.size() * 3 * sizeof(uint32_t));
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene, geometry);  // ids count up from 0, as the meshes do
  }
  rtcReleaseGeometry(geometry);
}

}  // namespace

absl::StatusOr<Scene> Scene::Build(SceneDescription description) {
  RETURN_IF_ERROR(CheckDescription(description));
  Scene scene;
  scene.description_ = std::move(description);
  // Building takes a tenth of a second on one thread, and what comes out does not depend on how many there are.
  scene.device_ = rtcNewDevice("threads=1");
  if (scene.device_ == nullptr) {
    return Error(absl::StatusCode::kInternal, "EMBREE", "Embree gives no device");
  }
  scene.scene_ = rtcNewScene(scene.device_);
  // Rays must not slip through where thin triangles meet.
  rtcSetSceneFlags(scene.scene_, RTC_SCENE_FLAG_ROBUST);
  for (const Mesh& mesh : scene.description_.meshes) {
    AttachMesh(scene.device_, scene.scene_, mesh);
  }
  rtcCommitScene(scene.scene_);
  if (RTCError error = rtcGetDeviceError(scene.device_); error != RTC_ERROR_NONE) {
    return Error(absl::StatusCode::kInternal, "EMBREE",
                 absl::StrCat("Embree cannot build the scene: error ", static_cast<int>(error)),
                 {{"error", absl::StrCat(static_cast<int>(error))}});
  }
  return scene;
}

Scene::Scene(Scene&& other) noexcept
    : description_(std::move(other.description_)),
      device_(std::exchange(other.device_, nullptr)),
      scene_(std::exchange(other.scene_, nullptr)) {}

Scene::~Scene() {
  if (scene_ != nullptr) rtcReleaseScene(scene_);
  if (device_ != nullptr) rtcReleaseDevice(device_);
}

Scene::Hit Scene::Resolve(uint32_t mesh_index, uint32_t triangle, float u, float v,
                          const Vec3f& direction) const {
  const Mesh& mesh = description_.meshes[mesh_index];
  const auto& t = mesh.triangles[triangle];
  const float w = 1 - u - v;
  Hit hit;
  hit.point = w * mesh.vertices[t[0]] + u * mesh.vertices[t[1]] + v * mesh.vertices[t[2]];
  hit.face = (mesh.vertices[t[1]] - mesh.vertices[t[0]])
                 .cross(mesh.vertices[t[2]] - mesh.vertices[t[0]])
                 .normalized();
  hit.normal =
      (w * mesh.normals[t[0]] + u * mesh.normals[t[1]] + v * mesh.normals[t[2]]).normalized();
  hit.outside = hit.face.dot(direction) <= 0;
  if (!hit.outside) {
    hit.face = -hit.face;
    hit.normal = -hit.normal;
  }
  hit.material = &description_.materials[mesh.material];
  hit.diffuse = hit.material->diffuse;
  if (hit.material->texture) hit.diffuse *= hit.material->texture(hit.point);
  return hit;
}

}  // namespace lightstage::sim
