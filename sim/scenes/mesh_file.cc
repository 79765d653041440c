#include "sim/scenes/mesh_file.h"

#include <assimp/MemoryIOWrapper.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <algorithm>
#include <array>
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
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "base/status.h"
#include "sim/scenes/in_child.h"

namespace lightstage::sim {
namespace {

absl::Status Wrong(const std::string& path, const std::string& why) {
  return Error(absl::StatusCode::kInvalidArgument, "MESH", absl::StrCat(path, ": ", why),
               {{"file", path}});
}

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

// The importers believe what a file says of itself. What they stumble over is looked for first.

// One element per line, as many as announced, and every face has corners that there are.
absl::Status CheckOff(const std::string& path, const std::string& bytes) {
  constexpr size_t kLongestLine = 4000;  // what the importer has room for
  size_t number = 0, elements = 0;
  uint64_t vertices = 0, faces = 0;
  bool counted = false;
  for (std::string_view rest = bytes; !rest.empty();) {
    const size_t end = std::min(rest.find('\n'), rest.size());
    std::string_view line = rest.substr(0, end);
    rest.remove_prefix(std::min(end + 1, rest.size()));
    ++number;
    auto wrong = [&](const std::string& what) {
      return Wrong(path, absl::StrCat("line ", number, ": ", what));
    };
    if (line.size() > kLongestLine) return wrong("is longer than 4000 characters");
    line = line.substr(0, std::min(line.find('#'), line.size()));
    std::vector<std::string> words =
        absl::StrSplit(std::string(line), absl::ByAnyChar(" \t\r"), absl::SkipEmpty());
    if (!words.empty() && !counted && words[0].ends_with("OFF")) words.erase(words.begin());
    if (words.empty()) continue;
    if (!counted) {
      if (words.size() < 2 || !absl::SimpleAtoi(words[0], &vertices) ||
          !absl::SimpleAtoi(words[1], &faces)) {
        return wrong("must have the numbers of vertices and faces");
      }
      if (vertices > bytes.size() || faces > bytes.size()) {
        return wrong(absl::StrCat("announces ", vertices, " vertices and ", faces,
                                  " faces, more than the file's ", bytes.size(),
                                  " bytes can hold"));
      }
      counted = true;
      continue;
    }
    if (elements >= vertices + faces) break;  // what else there is, is not read
    if (elements++ < vertices) continue;
    constexpr uint64_t kMostCorners = 9;  // that the importer takes
    uint64_t corners = 0;
    if (!absl::SimpleAtoi(words[0], &corners) || corners < 1 || words.size() <= corners) {
      return wrong("must have a face: how many corners, then each of them");
    }
    if (corners > kMostCorners) {
      return wrong(absl::StrCat("the face has ", corners, " corners; at most ", kMostCorners,
                                " can be read from OFF"));
    }
    for (uint64_t k = 1; k <= corners; ++k) {
      uint64_t vertex = 0;
      if (absl::SimpleAtoi(words[k], &vertex) && vertex < vertices) continue;
      return wrong(absl::StrCat("the face has the corner ", words[k], "; there are ", vertices,
                                " vertices"));
    }
  }
  if (!counted || elements < vertices + faces) {
    return Wrong(path, absl::StrCat("announces ", vertices, " vertices and ", faces,
                                    " faces, but has only ", elements, " lines for them"));
  }
  return absl::OkStatus();
}

// The faces that a PLY header announces; no more elements than the file can hold.
absl::StatusOr<uint64_t> CheckPly(const std::string& path, const std::string& bytes) {
  const size_t end = bytes.find("\nend_header");
  if (!bytes.starts_with("ply") || end == std::string::npos) {
    return Wrong(path, "is no PLY file: it must begin with 'ply' and have an 'end_header'");
  }
  uint64_t faces = 0, total = 0;
  bool text = false;
  for (absl::string_view line : absl::StrSplit(absl::string_view(bytes.data(), end), '\n')) {
    const std::vector<std::string> words =
        absl::StrSplit(line, absl::ByAnyChar(" \t\r"), absl::SkipEmpty());
    if (words.size() > 1 && words[0] == "format") text = words[1] == "ascii";
    if (words.size() < 3 || words[0] != "element") continue;
    uint64_t count = 0;
    if (!absl::SimpleAtoi(words[2], &count) || count > bytes.size()) {
      return Wrong(path, absl::StrCat("announces ", words[2], " of ", words[1], "; its ",
                                      bytes.size(), " bytes cannot hold them"));
    }
    total += count;
    if (words[1] == "face") faces = count;
  }
  if (text) {
    const auto lines = static_cast<uint64_t>(
        std::count(bytes.begin() + static_cast<ptrdiff_t>(end), bytes.end(), '\n'));
    // The header's own last line, and the last one may lack its end.
    if (lines + (bytes.back() != '\n') < total + 1) {
      return Wrong(path, absl::StrCat("announces ", total, " elements, but has only ", lines - 1,
                                      " lines for them"));
    }
  }
  return faces;
}

// What the importer has made of it.
absl::Status CheckImported(const std::string& path, const aiScene& scene) {
  for (unsigned int m = 0; m < scene.mNumMeshes; ++m) {
    const aiMesh& part = *scene.mMeshes[m];
    for (unsigned int v = 0; v < part.mNumVertices; ++v) {
      const aiVector3D& at = part.mVertices[v];
      if (std::isfinite(at.x) && std::isfinite(at.y) && std::isfinite(at.z)) continue;
      return Wrong(path, absl::StrCat("vertex ", v, " of part ", m, " is no number"));
    }
    for (unsigned int f = 0; f < part.mNumFaces; ++f) {
      const aiFace& face = part.mFaces[f];
      if (face.mIndices == nullptr || face.mNumIndices == 0) {
        return Wrong(path, absl::StrCat("face ", f, " of part ", m, " has no corners"));
      }
      for (unsigned int k = 0; k < face.mNumIndices; ++k) {
        if (face.mIndices[k] < part.mNumVertices) continue;
        return Wrong(path, absl::StrCat("face ", f, " of part ", m, " has the corner ",
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
  const aiScene* scene = importer.ReadFile(path, 0);
  if (scene != nullptr) {
    RETURN_IF_ERROR(CheckImported(path, *scene));
    uint64_t read = 0;
    for (unsigned int m = 0; m < scene->mNumMeshes; ++m) read += scene->mMeshes[m]->mNumFaces;
    if (faces > 0 && read != faces) {
      return Wrong(path, absl::StrCat("announces ", faces, " faces; ", read, " could be read"));
    }
    scene = importer.ApplyPostProcessing(aiProcess_Triangulate | aiProcess_PreTransformVertices |
                                         aiProcess_SortByPType | aiProcess_GenSmoothNormals |
                                         aiProcess_JoinIdenticalVertices);
  }
  if (scene == nullptr) {
    PassOnBadAlloc(importer.GetException());
    return Wrong(path, absl::StrCat("cannot be read: ", importer.GetErrorString()));
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
  if (mesh.triangles.empty()) return Wrong(path, "has no triangles");
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
    return Wrong(path, "must end with .off, .obj, .ply, .gltf or .glb");
  }
  // A regular file, for the importer would wait for a pipe.
  ASSIGN_OR_RETURN(const std::string bytes, ReadNamedFile(path, env));
  uint64_t faces = 0;
  if (extension == ".off") RETURN_IF_ERROR(CheckOff(path, bytes));
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
               : Wrong(path, why);
  }
  std::optional<Mesh> mesh = Unpack(*packed);
  if (!mesh.has_value()) return Wrong(path, "cannot be read: the importer's answer is no mesh");
  mesh->name = path;
  return *std::move(mesh);
}

}  // namespace lightstage::sim
