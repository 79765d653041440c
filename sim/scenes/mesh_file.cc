#include "sim/scenes/mesh_file.h"

#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <algorithm>
#include <array>
#include <assimp/DefaultLogger.hpp>
#include <assimp/Importer.hpp>
#include <assimp/LogStream.hpp>
#include <filesystem>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "base/mutex.h"
#include "base/status.h"

namespace lightstage::sim {
namespace {

absl::Status Wrong(const std::string& path, const std::string& why) {
  return Error(absl::StatusCode::kInvalidArgument, "MESH", absl::StrCat(path, ": ", why),
               {{"file", path}});
}

// The importers mend some files on their own and only write an error to the log. Here an error is an error.
class ErrorLog final : public Assimp::LogStream {
 public:
  explicit ErrorLog(std::string* first) : first_(first) {}
  void write(const char* message) override {
    if (first_->empty()) *first_ = std::string(absl::StripAsciiWhitespace(message));
  }

 private:
  std::string* const first_;
};

// The library's log is one for the process: held while one file is read.
class LoggedImport {
 public:
  LoggedImport() {
    mutex_.Lock();
    Assimp::DefaultLogger::create(nullptr, Assimp::Logger::NORMAL, 0);
    Assimp::DefaultLogger::get()->attachStream(new ErrorLog(&error_),
                                               Assimp::Logger::Err);  // which owns it
  }
  ~LoggedImport() {
    Assimp::DefaultLogger::kill();
    mutex_.Unlock();
  }
  LoggedImport(const LoggedImport&) = delete;
  LoggedImport& operator=(const LoggedImport&) = delete;
  const std::string& error() const { return error_; }

 private:
  static inline Mutex mutex_;
  std::string error_;
};

Vec3f ToVec(const aiVector3D& v, bool y_up) {
  return y_up ? Vec3f(v.x, -v.z, v.y) : Vec3f(v.x, v.y, v.z);
}

}  // namespace

absl::StatusOr<Mesh> ReadMesh(const std::string& path, Angle crease, Env& env) {
  const std::string extension =
      absl::AsciiStrToLower(std::filesystem::path(path).extension().string());
  constexpr std::array kKnown = {".off", ".obj", ".ply", ".gltf", ".glb"};
  if (std::find(kKnown.begin(), kKnown.end(), extension) == kKnown.end()) {
    return Wrong(path, "must end with .off, .obj, .ply, .gltf or .glb");
  }
  RETURN_IF_ERROR(env.ReadInput(path).status());  // says why not, better than the importer
  const LoggedImport logged;
  Assimp::Importer importer;
  importer.SetPropertyFloat(AI_CONFIG_PP_GSN_MAX_SMOOTHING_ANGLE,
                            static_cast<float>(crease.degrees()));
  importer.SetPropertyInteger(AI_CONFIG_PP_SBP_REMOVE,
                              aiPrimitiveType_POINT | aiPrimitiveType_LINE);
  const aiScene* scene = importer.ReadFile(path, 0);
  // Before vertices are compared, of which a number that is none makes nonsense.
  for (unsigned int m = 0; scene != nullptr && m < scene->mNumMeshes; ++m) {
    const aiMesh& part = *scene->mMeshes[m];
    for (unsigned int v = 0; v < part.mNumVertices; ++v) {
      if (ToVec(part.mVertices[v], false).allFinite()) continue;
      return Wrong(path, absl::StrCat("vertex ", v, " of part ", m, " is no number"));
    }
  }
  if (scene != nullptr) {
    scene = importer.ApplyPostProcessing(aiProcess_Triangulate | aiProcess_PreTransformVertices |
                                         aiProcess_SortByPType | aiProcess_GenSmoothNormals |
                                         aiProcess_JoinIdenticalVertices);
  }
  if (scene == nullptr)
    return Wrong(path, absl::StrCat("cannot be read: ", importer.GetErrorString()));
  if (!logged.error().empty()) return Wrong(path, logged.error());
  const bool y_up = extension == ".gltf" || extension == ".glb";
  Mesh mesh;
  mesh.name = path;
  bool all_uvs = true;
  for (unsigned int m = 0; m < scene->mNumMeshes; ++m)
    all_uvs &= scene->mMeshes[m]->HasTextureCoords(0);
  for (unsigned int m = 0; m < scene->mNumMeshes; ++m) {
    const aiMesh& part = *scene->mMeshes[m];
    const auto first = static_cast<uint32_t>(mesh.vertices.size());
    for (unsigned int v = 0; v < part.mNumVertices; ++v) {
      mesh.vertices.push_back(ToVec(part.mVertices[v], y_up));
      mesh.normals.push_back(part.HasNormals() ? ToVec(part.mNormals[v], y_up).normalized()
                                               : Vec3f::Zero());
      if (all_uvs) mesh.uvs.emplace_back(part.mTextureCoords[0][v].x, part.mTextureCoords[0][v].y);
    }
    for (unsigned int f = 0; f < part.mNumFaces; ++f) {
      const aiFace& face = part.mFaces[f];
      if (face.mNumIndices != 3) continue;
      mesh.triangles.push_back(
          {first + face.mIndices[0], first + face.mIndices[1], first + face.mIndices[2]});
    }
  }
  if (mesh.triangles.empty()) return Wrong(path, "has no triangles");
  return mesh;
}

}  // namespace lightstage::sim
