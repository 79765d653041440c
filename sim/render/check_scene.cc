#include "sim/render/check_scene.h"

#include <cmath>

#include "absl/container/flat_hash_map.h"
#include "absl/strings/str_format.h"
#include "base/status.h"
#include "sim/render/winding.h"

namespace lightstage::sim {

std::string NameOf(const Mesh& mesh, size_t index) {
  return mesh.name.empty() ? absl::StrCat("mesh ", index) : mesh.name;
}

namespace {

absl::Status Wrong(const std::string& shape, const std::string& what) {
  return Error(absl::StatusCode::kInvalidArgument, "SCENE", absl::StrCat(shape, ": ", what),
               {{"shape", shape}});
}

absl::Status CheckMaterial(const Material& m, size_t index) {
  const std::string name = absl::StrCat("material ", index);
  auto color = [](const Rgb& c) { return (c >= 0).all() && (c <= 1).all(); };
  if (!color(m.diffuse) || !color(m.specular)) {
    return Wrong(name, "its colours must be from 0 to 1");
  }
  if (!(m.roughness >= 0.01f && m.roughness <= 1)) {
    return Wrong(name, absl::StrCat("its roughness is ", m.roughness, ", must be from 0.01 to 1"));
  }
  if (!(m.ior >= 1 && m.ior <= 4)) {
    return Wrong(name, absl::StrCat("its refractive index is ", m.ior, ", must be from 1 to 4"));
  }
  if (m.kind == Material::Kind::kMedium) {
    if (!(m.extinction > 0 && m.extinction <= 1e6f)) {
      return Wrong(name, absl::StrCat("a medium's extinction is ", m.extinction,
                                      " 1/m, must be above 0 and at most 1e6"));
    }
    if (!(std::abs(m.anisotropy) < 0.9999f)) {
      return Wrong(name, absl::StrCat("a medium's anisotropy is ", m.anisotropy,
                                      ", must be above -1 and below 1"));
    }
  }
  return absl::OkStatus();
}

// Every edge of a closed surface has a triangle on either side, which run through it in opposite directions. Vertices at the same
// place count as one, for creases have several.
absl::Status CheckClosed(const Mesh& mesh, const std::string& name) {
  const std::vector<uint32_t> at = Places(mesh);
  absl::flat_hash_map<std::pair<uint32_t, uint32_t>, int> edges;  // directed: how often
  for (const auto& t : mesh.triangles) {
    for (int k = 0; k < 3; ++k) ++edges[{at[t[k]], at[t[(k + 1) % 3]]}];
  }
  for (size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (int k = 0; k < 3; ++k) {
      const uint32_t a = mesh.triangles[t][k], b = mesh.triangles[t][(k + 1) % 3];
      auto there = edges.find({at[b], at[a]});
      if (there != edges.end() && there->second == edges[{at[a], at[b]}]) continue;
      return Wrong(
          name, absl::StrFormat("it is not closed, as glass and media must be: triangle %d has no "
                                "neighbour at its edge from vertex %d to %d",
                                t, a, b));
    }
  }
  double volume = 0;
  for (const auto& t : mesh.triangles) {
    const Eigen::Vector3d a = mesh.vertices[t[0]].cast<double>(),
                          b = mesh.vertices[t[1]].cast<double>(),
                          c = mesh.vertices[t[2]].cast<double>();
    volume += a.dot(b.cross(c)) / 6;
  }
  if (volume <= 0) {
    return Wrong(
        name,
        "it is inside out, which glass and media must not be: seen from outside its triangles' "
        "corners must go round counterclockwise");
  }
  return absl::OkStatus();
}

// Where the shading normals of most corners are on the other side of the face, the file has them the wrong way round.
absl::Status CheckNormals(const Mesh& mesh, const std::string& name) {
  for (size_t v = 0; v < mesh.normals.size(); ++v) {
    if (!(std::abs(mesh.normals[v].norm() - 1) < 1e-3f)) {
      return Wrong(name, absl::StrFormat("the normal of vertex %d has the length %g, must be 1", v,
                                         mesh.normals[v].norm()));
    }
  }
  size_t against = 0;
  for (const auto& t : mesh.triangles) {
    const Vec3f face = (mesh.vertices[t[1]] - mesh.vertices[t[0]])
                           .cross(mesh.vertices[t[2]] - mesh.vertices[t[0]]);
    for (uint32_t v : t) against += face.dot(mesh.normals[v]) < 0;
  }
  if (2 * against > 3 * mesh.triangles.size()) {
    return Wrong(
        name,
        absl::StrFormat("the normals of %d of its %d corners are on the other side of their faces",
                        against, 3 * mesh.triangles.size()));
  }
  return absl::OkStatus();
}

absl::Status CheckMesh(const Mesh& mesh, const std::string& name) {
  if (mesh.triangles.empty()) return Wrong(name, "it has no triangles");
  if (mesh.normals.size() != mesh.vertices.size()) {
    return Wrong(name, absl::StrFormat("it has %d normals for %d vertices", mesh.normals.size(),
                                       mesh.vertices.size()));
  }
  if (!mesh.uvs.empty() && mesh.uvs.size() != mesh.vertices.size()) {
    return Wrong(name, absl::StrFormat("it has %d texture coordinates for %d vertices",
                                       mesh.uvs.size(), mesh.vertices.size()));
  }
  for (size_t v = 0; v < mesh.vertices.size(); ++v) {
    const Vec3f& p = mesh.vertices[v];
    if (!p.allFinite() || p.cwiseAbs().maxCoeff() > 1e3f) {
      return Wrong(
          name, absl::StrFormat(
                    "vertex %d is at (%g, %g, %g) m; each must be a number from -1000 to 1000", v,
                    p.x(), p.y(), p.z()));
    }
    if (!mesh.uvs.empty() && !(mesh.uvs[v].cwiseAbs().maxCoeff() <= 1e6f)) {
      return Wrong(name,
                   absl::StrFormat(
                       "the texture coordinates of vertex %d are (%g, %g); each must be a number "
                       "from -1e6 to 1e6",
                       v, mesh.uvs[v].x(), mesh.uvs[v].y()));
    }
  }
  for (size_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto& triangle = mesh.triangles[t];
    for (uint32_t v : triangle) {
      if (v < mesh.vertices.size()) continue;
      return Wrong(name, absl::StrFormat("triangle %d has the vertex %d; there are only %d", t, v,
                                         mesh.vertices.size()));
    }
    const Vec3f &a = mesh.vertices[triangle[0]], &b = mesh.vertices[triangle[1]],
                &c = mesh.vertices[triangle[2]];
    if (!((b - a).cast<double>().cross((c - a).cast<double>()).norm() > 0)) {
      return Wrong(name, absl::StrFormat("triangle %d (vertices %d, %d, %d) has no area", t,
                                         triangle[0], triangle[1], triangle[2]));
    }
  }
  RETURN_IF_ERROR(CheckNormals(mesh, name));
  for (size_t i = 0; i < mesh.placements.size(); ++i) {
    const Eigen::Matrix3f m = mesh.placements[i].linear(), square = m * m.transpose();
    const float scale = square.trace() / 3;
    const bool similar = mesh.placements[i].matrix().allFinite() && m.determinant() > 0 &&
                         (square - scale * Eigen::Matrix3f::Identity()).norm() < 1e-3f * scale;
    if (!similar) {
      return Wrong(name,
                   absl::StrFormat("placement %d is no rotation with one scale for all axes", i));
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status CheckScene(const SceneDescription& description) {
  const int materials = static_cast<int>(description.materials.size());
  for (size_t i = 0; i < description.materials.size(); ++i) {
    RETURN_IF_ERROR(CheckMaterial(description.materials[i], i));
  }
  auto check_index = [materials](const std::string& name, int material) {
    if (material >= 0 && material < materials) return absl::OkStatus();
    return Wrong(name,
                 absl::StrFormat("it has the material %d; there are only %d", material, materials));
  };
  for (size_t i = 0; i < description.meshes.size(); ++i) {
    const Mesh& mesh = description.meshes[i];
    const std::string name = NameOf(mesh, i);
    RETURN_IF_ERROR(check_index(name, mesh.material));
    RETURN_IF_ERROR(CheckMesh(mesh, name));
    if (description.materials[mesh.material].has_inside()) RETURN_IF_ERROR(CheckClosed(mesh, name));
  }
  for (size_t i = 0; i < description.balls.size(); ++i) {
    const Ball& ball = description.balls[i];
    const std::string name = absl::StrCat("ball ", i);
    RETURN_IF_ERROR(check_index(name, ball.material));
    if (!ball.center.allFinite() || !(ball.radius >= 1e-4f && ball.radius <= 1e3f)) {
      return Wrong(name,
                   absl::StrFormat(
                       "its radius is %g m at (%g, %g, %g); must be a number from 0.0001 to 1000",
                       ball.radius, ball.center.x(), ball.center.y(), ball.center.z()));
    }
  }
  return absl::OkStatus();
}

}  // namespace lightstage::sim
