#include "sim/scenes/mesh_file.h"

#include <assimp/MemoryIOWrapper.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <algorithm>
#include <array>
#include <assimp/DefaultLogger.hpp>
#include <assimp/IOStream.hpp>
#include <assimp/IOSystem.hpp>
#include <assimp/Importer.hpp>
#include <cmath>
#include <cstring>
#include <exception>
#include <filesystem>
#include <map>
#include <new>
#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "base/status.h"
#include "sim/scenes/check_mesh_file.h"
#include "sim/scenes/in_child.h"

namespace lightstage::sim {
namespace {

// glTF names files by URI, where a blank is %20 (RFC 3986, section 2.1).
std::string Unescaped(const std::string& uri) {
  std::string out;
  for (size_t i = 0; i < uri.size(); ++i) {
    if (uri[i] == '%' && i + 2 < uri.size() && absl::ascii_isxdigit(uri[i + 1]) &&
        absl::ascii_isxdigit(uri[i + 2])) {
      out += absl::HexStringToBytes(uri.substr(i + 1, 2));
      i += 2;
    } else {
      out += uri[i];
    }
  }
  return out;
}

// What the importer may read: the file, whose bytes are here already, and for glTF its buffers beside it. Nothing else on the disk,
// whatever the file names.
class FileAndBuffers final : public Assimp::IOSystem {
 public:
  FileAndBuffers(std::string path, const std::string& bytes, bool buffers, Env& env)
      : path_(std::move(path)), buffers_(buffers), env_(env) {
    files_[path_] = bytes;
  }
  bool Exists(const char* file) const override { return Get(file) != nullptr; }
  char getOsSeparator() const override { return '/'; }
  Assimp::IOStream* Open(const char* file, const char*) override {
    const std::string* bytes = Get(file);
    return bytes == nullptr ? nullptr
                            : new Assimp::MemoryIOStream(
                                  reinterpret_cast<const uint8_t*>(bytes->data()), bytes->size());
  }
  void Close(Assimp::IOStream* stream) override { delete stream; }

 private:
  const std::string* Get(const std::string& file) const {
    if (auto it = files_.find(file); it != files_.end()) return &it->second;
    if (!buffers_) return nullptr;
    // Where links lead is what counts.
    namespace fs = std::filesystem;
    std::error_code error;
    const fs::path folder = fs::weakly_canonical(fs::absolute(path_, error).parent_path(), error);
    if (error) return nullptr;
    for (const std::string& name : {file, Unescaped(file)}) {  // mostly the same
      const fs::path target = fs::weakly_canonical(fs::absolute(name, error), error);
      if (error) return nullptr;
      const fs::path relative = target.lexically_relative(folder);
      if (relative.empty() || *relative.begin() == "..") continue;
      auto bytes = ReadNamedFile(target.string(), env_);
      if (bytes.ok()) return &(files_[file] = *std::move(bytes));
    }
    return nullptr;
  }

  const std::string path_;
  const bool buffers_;
  Env& env_;
  mutable std::map<std::string, std::string> files_;
};

// What the importer has made of it.
absl::Status CheckImported(const std::string& path, const aiScene& scene) {
  for (unsigned int m = 0; m < scene.mNumMeshes; ++m) {
    const aiMesh& part = *scene.mMeshes[m];
    for (unsigned int v = 0; v < part.mNumVertices; ++v) {
      const aiVector3D& at = part.mVertices[v];
      if (std::isfinite(at.x) && std::isfinite(at.y) && std::isfinite(at.z)) continue;
      return WrongMesh(path, absl::StrCat("vertex ", v, " of part ", m, " is no number"));
    }
    for (unsigned int f = 0; f < part.mNumFaces; ++f) {
      const aiFace& face = part.mFaces[f];
      if (face.mIndices == nullptr || face.mNumIndices == 0) {
        return WrongMesh(path, absl::StrCat("face ", f, " of part ", m, " has no corners"));
      }
      for (unsigned int k = 0; k < face.mNumIndices; ++k) {
        if (face.mIndices[k] < part.mNumVertices) continue;
        return WrongMesh(path, absl::StrCat("face ", f, " of part ", m, " has the corner ",
                                            static_cast<int32_t>(face.mIndices[k]), "; there are ",
                                            part.mNumVertices, " vertices"));
      }
    }
  }
  return absl::OkStatus();
}

Vec3f ToVec(const aiVector3D& v, bool y_up) {
  return y_up ? Vec3f(v.x, -v.z, v.y) : Vec3f(v.x, v.y, v.z);
}

// The importer catches what RunInChild knows better what to say of.
void PassOnBadAlloc(const std::exception_ptr& thrown) {
  if (thrown == nullptr) return;
  try {
    std::rethrow_exception(thrown);
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception&) {
  }
}

// The importer of glTF leaves out faces whose corners are out of range or not three, with a warning that they "were dropped".
class Dropped final : public Assimp::LogStream {
 public:
  explicit Dropped(std::string* warning) : warning_(warning) {}
  void write(const char* line) override {
    const std::string text(absl::StripAsciiWhitespace(line));  // "Warn,  T0: Some …"
    if (absl::StrContains(text, "dropped")) *warning_ = text.substr(text.find(": ") + 2);
  }

 private:
  std::string* const warning_;
};

// The importer's part, in the child.
absl::StatusOr<Mesh> Import(const std::string& path, const std::string& extension,
                            const std::string& bytes, uint64_t faces, Angle crease, Env& env) {
  Assimp::Importer importer;
  importer.SetIOHandler(
      new FileAndBuffers(path, bytes, extension.starts_with(".gl"), env));  // which it owns
  importer.SetPropertyFloat(AI_CONFIG_PP_GSN_MAX_SMOOTHING_ANGLE,
                            static_cast<float>(crease.degrees()));
  importer.SetPropertyInteger(AI_CONFIG_PP_SBP_REMOVE,
                              aiPrimitiveType_POINT | aiPrimitiveType_LINE);
  std::string dropped;
  Assimp::DefaultLogger::create("", Assimp::Logger::NORMAL, 0)
      ->attachStream(new Dropped(&dropped), Assimp::Logger::Warn);  // which owns it
  const aiScene* scene = importer.ReadFile(path, 0);
  Assimp::DefaultLogger::kill();
  if (scene != nullptr) {
    if (!dropped.empty()) return WrongMesh(path, absl::StrCat("cannot be read whole: ", dropped));
    RETURN_IF_ERROR(CheckImported(path, *scene));
    uint64_t read = 0;
    for (unsigned int m = 0; m < scene->mNumMeshes; ++m) {
      const aiMesh& part = *scene->mMeshes[m];
      read += std::count_if(part.mFaces, part.mFaces + part.mNumFaces,
                            [](const aiFace& face) { return face.mNumIndices >= 3; });
    }
    if (faces > 0 && read != faces) {
      return WrongMesh(path, absl::StrCat("has ", faces, " faces; ", read, " could be read"));
    }
    scene = importer.ApplyPostProcessing(aiProcess_Triangulate | aiProcess_PreTransformVertices |
                                         aiProcess_SortByPType | aiProcess_GenSmoothNormals |
                                         aiProcess_JoinIdenticalVertices);
  }
  if (scene == nullptr) {
    PassOnBadAlloc(importer.GetException());
    return WrongMesh(path, absl::StrCat("cannot be read: ", importer.GetErrorString()));
  }
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
  if (mesh.triangles.empty()) return WrongMesh(path, "has no triangles");
  return mesh;
}

// A mesh as bytes, from the child to its parent: how many vertices, texture coordinates and triangles, then they.
template <class T>
void Put(const std::vector<T>& values, std::string* to) {
  to->append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
}

std::string Pack(const Mesh& mesh) {
  std::string bytes;
  Put(std::vector<uint64_t>{mesh.vertices.size(), mesh.uvs.size(), mesh.triangles.size()}, &bytes);
  Put(mesh.vertices, &bytes);
  Put(mesh.normals, &bytes);
  Put(mesh.uvs, &bytes);
  Put(mesh.triangles, &bytes);
  return bytes;
}

template <class T>
const char* Take(const char* from, size_t count, std::vector<T>* values) {
  values->resize(count);
  if (count > 0) std::memcpy(static_cast<void*>(values->data()), from, count * sizeof(T));
  return from + count * sizeof(T);
}

// None if the bytes are no mesh: the child may have come to harm.
std::optional<Mesh> Unpack(const std::string& bytes) {
  Mesh mesh;
  std::vector<uint64_t> counts(3);
  if (bytes.size() < counts.size() * sizeof(uint64_t)) return {};
  const char* at = Take(bytes.data(), counts.size(), &counts);
  if (*std::max_element(counts.begin(), counts.end()) > bytes.size() ||
      bytes.size() != counts.size() * sizeof(uint64_t) + counts[0] * 2 * sizeof(Vec3f) +
                          counts[1] * sizeof(Vec2f) + counts[2] * sizeof(mesh.triangles[0])) {
    return {};
  }
  at = Take(at, counts[0], &mesh.vertices);
  at = Take(at, counts[0], &mesh.normals);
  at = Take(at, counts[1], &mesh.uvs);
  Take(at, counts[2], &mesh.triangles);
  return mesh;
}

}  // namespace

absl::StatusOr<Mesh> ReadMesh(const std::string& path, Angle crease, Env& env) {
  const std::string extension =
      absl::AsciiStrToLower(std::filesystem::path(path).extension().string());
  constexpr std::array kKnown = {".off", ".obj", ".ply", ".gltf", ".glb"};
  if (std::find(kKnown.begin(), kKnown.end(), extension) == kKnown.end()) {
    return WrongMesh(path, "must end with .off, .obj, .ply, .gltf or .glb");
  }
  // A regular file, for the importer would wait for a pipe.
  ASSIGN_OR_RETURN(const std::string bytes, ReadNamedFile(path, env));
  uint64_t faces = 0;
  if (extension == ".off") RETURN_IF_ERROR(CheckOff(path, bytes));
  if (extension == ".obj") {
    ASSIGN_OR_RETURN(faces, CheckObj(path, bytes));
  }
  if (extension == ".ply") {
    ASSIGN_OR_RETURN(faces, CheckPly(path, bytes));
  }
  // In a process of its own: the importer crashes on some malformed files, and on others takes all memory or for ever.
  auto packed = RunInChild([&]() -> absl::StatusOr<std::string> {
    ASSIGN_OR_RETURN(const Mesh mesh, Import(path, extension, bytes, faces, crease, env));
    return Pack(mesh);
  });
  if (!packed.ok()) {
    const std::string why = MessageOf(packed.status());
    return why.starts_with(path)
               ? Error(absl::StatusCode::kInvalidArgument, "MESH", why, {{"file", path}})
               : WrongMesh(path, why);
  }
  std::optional<Mesh> mesh = Unpack(*packed);
  if (!mesh.has_value()) return WrongMesh(path, "cannot be read: the importer's answer is no mesh");
  mesh->name = path;
  return *std::move(mesh);
}

}  // namespace lightstage::sim
