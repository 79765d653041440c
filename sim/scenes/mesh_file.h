// Meshes from files, by assimp.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "base/env.h"
#include "base/units.h"
#include "sim/render/scene.h"

namespace lightstage::sim {

// All triangles and polygons of a file (OFF, OBJ, PLY, glTF), as one mesh in the file's own coordinates, +Z up: glTF, which has +Y up,
// is turned. Where the file has no normals they are averaged over faces that meet at less than `crease`. Textures and materials in the
// file are not used. INVALID_ARGUMENT / MESH naming the file; its reading's own errors. What Scene::Build checks is not checked here.
absl::StatusOr<Mesh> ReadMesh(const std::string& path, Angle crease, Env& env = PosixEnv());

}  // namespace lightstage::sim
