#include "sim/render/triangles.h"

#include <cstring>

namespace lightstage::sim {

RTCGeometry MakeTriangles(RTCDevice device, const Mesh& mesh) {
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
  }
  return geometry;
}

}  // namespace lightstage::sim
