#include "sim/scenes/scene_file.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <set>

#include "absl/strings/str_cat.h"
#include "base/status.h"
#include "base/toml.h"
#include "sim/scenes/builder.h"
#include "sim/scenes/mesh_file.h"
#include "sim/scenes/texture.h"

namespace lightstage::sim {
namespace {

Vec3f ToVec(const std::vector<double>& v) {
  if (v.size() != 3) return Vec3f::Zero();  // an error that is recorded already
  return {static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2])};
}

Vec3f Position(const TomlTable& table, const char* key) {
  return ToVec(table.Doubles(key, -100, 100, 3, std::vector<double>{0, 0, 0}));
}

class Reader {
 public:
  Reader(std::filesystem::path directory, Env& env) : directory_(std::move(directory)), env_(env) {}

  void Read(const TomlTable& root) {
    if (root.Bool("turntable", true)) PutGround(&builder_);
    const TomlTable materials = root.Table("material");
    for (const std::string& name : materials.Keys()) {
      const TomlTable table = materials.Table(name);
      materials_[name] = builder_.Add(ReadMaterial(table));
      if (needs_uv_) uv_materials_.insert(name);
      needs_uv_ = false;
    }
    for (const TomlTable& table : root.Tables("mesh")) ReadMeshTable(table);
    for (const TomlTable& table : root.Tables("ball")) {
      const Vec3f center = Position(table, "center_m");
      builder_.PutBall(center, static_cast<float>(table.Double("radius_m", 1e-4, 100)),
                       MaterialOf(table));
    }
    int boxes = 0;
    for (const TomlTable& table : root.Tables("box")) {
      RequireUv(table, "a box");
      const Vec3f center = Position(table, "center_m"),
                  size = ToVec(table.Doubles("size_m", 1e-5, 100, 3));
      const auto yaw = static_cast<float>(Degrees(table.Double("yaw_deg", -360, 360, 0)).radians());
      Mesh box = Box(center, size / 2, yaw);
      box.name = absl::StrCat("box ", boxes++);
      builder_.Put(std::move(box), MaterialOf(table));
    }
  }

  SceneDescription Take() { return builder_.Take(); }

 private:
  static Rgb Color(const TomlTable& table, const char* key, double fallback) {
    return ToVec(table.Doubles(key, 0, 1, 3, std::vector<double>(3, fallback))).array();
  }

  Material ReadMaterial(const TomlTable& table) {
    Material m;
    const std::string kind =
        table.OneOf("kind", {"surface", "mirror", "glass", "medium"}, "surface");
    if (kind == "surface") {
      m.diffuse = Color(table, "diffuse", 0);
      m.specular = Color(table, "specular", 0);
      m.roughness = static_cast<float>(table.Double("roughness", 0.01, 1, 1));
      if ((m.diffuse == 0).all() && (m.specular == 0).all() && !table.Has("diffuse")) {
        table.ErrorAt("", "needs a colour: diffuse or specular");
      }
    } else if (kind == "mirror") {
      m.kind = Material::Kind::kMirror;
      m.specular = Color(table, "specular", 1);
    } else if (kind == "glass") {
      m.kind = Material::Kind::kGlass;
      m.ior = static_cast<float>(table.Double("ior", 1, 4, 1.5));
    } else {
      m.kind = Material::Kind::kMedium;
      m.diffuse = Color(table, "albedo", 1);
      m.extinction = static_cast<float>(1 / table.Double("mean_free_path_m", 1e-6, 100));
      m.anisotropy = static_cast<float>(table.Double("anisotropy", -0.99, 0.99, 0));
    }
    if (table.Has("texture")) m.texture = ReadTextureTable(table.Table("texture"));
    return m;
  }

  // "" after an error.
  static std::string FileOf(const TomlTable& table) {
    std::string file = table.String("file");
    if (file.empty() && table.Has("file")) table.ErrorAt("file", "must be the name of a file");
    return file;
  }

  Texture ReadTextureTable(const TomlTable& table) {
    const std::string kind = table.OneOf("kind", {"picture", "checker", "wood"}, "picture");
    if (kind == "wood") return Wood;
    if (kind == "checker") {
      // Cubes in space, so that every shape can have it.
      const auto size = static_cast<float>(table.Double("size_m", 1e-4, 100));
      const auto dark = static_cast<float>(table.Double("dark", 0, 1, 0));
      return [size, dark](const SurfacePoint& at) {
        const int sum = static_cast<int>(std::floor(at.position.x() / size)) +
                        static_cast<int>(std::floor(at.position.y() / size)) +
                        static_cast<int>(std::floor(at.position.z() / size));
        return Rgb(Rgb::Constant(sum % 2 == 0 ? 1.0f : dark));
      };
    }
    const std::string file = FileOf(table);
    const std::string from = table.OneOf("projection", {"uv", "xy", "xz", "yz"}, "uv");
    const auto repeat = static_cast<float>(table.Double("repeat", 1e-3, 1e3, 1));
    // Of the object frame's coordinates: a texture as large as this.
    const float size = from == "uv" ? 1.0f : static_cast<float>(table.Double("size_m", 1e-4, 100));
    if (file.empty()) return {};
    absl::StatusOr<Image> picture = ReadTexture((directory_ / file).string(), env_);
    if (!picture.ok()) {
      table.ErrorAt("file", MessageOf(picture.status()));
      return {};
    }
    auto shared =
        std::make_shared<const Image>(*std::move(picture));  // shared: materials are copied
    const int a = from == "yz" ? 1 : 0, b = from == "xy" ? 1 : 2;
    const bool uv = from == "uv";
    needs_uv_ = uv;
    return [shared, a, b, uv, scale = repeat / size](const SurfacePoint& at) {
      return Lookup(*shared, scale * (uv ? at.uv : Vec2f(at.position[a], at.position[b])));
    };
  }

  int MaterialOf(const TomlTable& table) {
    const std::string name = table.String("material");
    auto it = materials_.find(name);
    if (it != materials_.end()) return it->second;
    if (table.Has("material")) {
      std::string known;
      for (const auto& [other, index] : materials_)
        absl::StrAppend(&known, known.empty() ? "" : ", ", other);
      table.ErrorAt("material", absl::StrCat("there is no [material.", name,
                                             "]; there are: ", known.empty() ? "none" : known));
    }
    return 0;
  }

  // Rotation about x, then y, then z, then a move.
  static Eigen::Affine3f Placement(const TomlTable& table) {
    const Vec3f turn =
        ToVec(table.Doubles("rotate_deg", -360, 360, 3, std::vector<double>{0, 0, 0})) *
        static_cast<float>(Degrees(1).radians());
    Eigen::Affine3f out(Eigen::AngleAxisf(turn.z(), Vec3f::UnitZ()) *
                        Eigen::AngleAxisf(turn.y(), Vec3f::UnitY()) *
                        Eigen::AngleAxisf(turn.x(), Vec3f::UnitX()));
    out.pretranslate(Position(table, "position_m"));
    return out;
  }

  void ReadMeshTable(const TomlTable& table) {
    const std::string file = FileOf(table);
    const Angle crease = Degrees(table.Double("crease_deg", 0, 175, 60));
    const bool by_size = table.Has("size_m");
    const double size = by_size ? table.Double("size_m", 1e-4, 100) : 0;
    const double scale = by_size ? 1 : table.Double("scale", 1e-6, 1e6, 1);
    if (by_size && table.Has("scale")) table.ErrorAt("scale", "give size_m or scale, not both");
    const bool stand = table.Bool("stand", true);
    const Eigen::Affine3f placement = Placement(table);
    const int material = MaterialOf(table);
    std::vector<Eigen::Affine3f> copies;
    for (const TomlTable& at : table.Tables("copy")) copies.push_back(Placement(at));
    if (file.empty()) return;
    absl::StatusOr<Mesh> mesh = ReadMesh((directory_ / file).string(), crease, env_);
    if (!mesh.ok()) {
      table.ErrorAt("file", MessageOf(mesh.status()));
      return;
    }
    if (mesh->uvs.empty()) RequireUv(table, "this mesh");
    Eigen::AlignedBox3f box;
    for (const Vec3f& v : mesh->vertices) box.extend(v);
    const float extent = box.sizes().maxCoeff();
    if (by_size && !(extent > 0)) {
      table.ErrorAt("file",
                    absl::StrCat(mesh->name, ": all vertices are in one place, it has no size"));
      return;
    }
    const auto factor = static_cast<float>(by_size ? size / extent : scale);
    // Its middle over the origin, its lowest point at z = 0; then as it is placed.
    const Vec3f middle = box.center(), foot(middle.x(), middle.y(), box.min().z());
    Eigen::Affine3f own = Eigen::Affine3f::Identity();
    own.scale(factor);
    if (stand) own.translate(-foot);
    Mesh out = Transformed(*std::move(mesh), own);
    if (copies.empty()) {
      out = Transformed(std::move(out), placement);
    } else {
      for (const Eigen::Affine3f& copy : copies) out.placements.push_back(copy * placement);
    }
    builder_.Put(std::move(out), material);
  }

  // A texture that is looked up by texture coordinates needs some.
  void RequireUv(const TomlTable& table, const char* what) const {
    if (uv_materials_.contains(table.String("material"))) {
      table.ErrorAt("material",
                    absl::StrCat("has a texture by texture coordinates, which ", what,
                                 " does not have: give the texture a projection of xy, xz or yz"));
    }
  }

  const std::filesystem::path directory_;
  Env& env_;
  Builder builder_;
  std::map<std::string, int> materials_;
  std::set<std::string> uv_materials_;
  bool needs_uv_ = false;  // the material that is being read
};

}  // namespace

absl::StatusOr<SceneDescription> ReadSceneFile(const std::string& path, Env& env) {
  ASSIGN_OR_RETURN(std::string text, ReadNamedFile(path, env));
  ASSIGN_OR_RETURN(TomlDocument document, TomlDocument::Parse(text, path));
  Reader reader(std::filesystem::path(path).parent_path(), env);
  reader.Read(document.root());
  RETURN_IF_ERROR(document.Finish());
  return reader.Take();
}

}  // namespace lightstage::sim
