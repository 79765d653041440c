// Scene files, the meshes and textures that they name, and the shipped scenes.
#include "sim/scenes/scenes.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "absl/strings/str_cat.h"
#include "sim/render/illuminate.h"
#include "sim/render/test_scene.h"
#include "sim/scenes/mesh_file.h"
#include "sim/scenes/texture.h"

namespace lightstage::sim {
namespace {

namespace fs = std::filesystem;

// Some light on what stands on the turntable, small and quick.
Image Look(const Scene& scene) {
  const CameraGeometry camera{Vec3(0, -1.1, 0.55), Vec3(0, 0, 0.075), Degrees(17)};
  const BraceGeometry brace{Meters(1), Meters(0.02), {{Degrees(-60), Degrees(40)}}};
  const Paths paths(scene, camera, 64, 48, {.samples = 4, .bounces = 2});
  return Illuminate(scene, paths, LampLight(brace, 0, Degrees(0), 10, 1));
}

class SceneFiles : public testing::Test {
 protected:
  void SetUp() override {
    directory_ = fs::path(testing::TempDir()) /
                 testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::remove_all(directory_);
    fs::create_directories(directory_);
  }
  void TearDown() override { fs::remove_all(directory_); }

  void Write(const std::string& name, const std::string& text) {
    std::ofstream(directory_ / name) << text;
  }
  absl::StatusOr<SceneDescription> Load(const std::string& text) {
    Write("scene.toml", text);
    return LoadScene("scene.toml", directory_.string());
  }
  // Loading or building it fails, with all of these words in the message.
  void ExpectRefused(const std::string& text, const std::vector<std::string>& words) {
    absl::StatusOr<SceneDescription> description = Load(text);
    absl::Status status = description.status();
    if (status.ok()) status = Scene::Build(*std::move(description)).status();
    EXPECT_FALSE(status.ok()) << text;
    for (const std::string& word : words) {
      EXPECT_NE(status.message().find(word), std::string::npos)
          << "'" << word << "' is not in " << status;
    }
  }
  fs::path directory_;
};

constexpr char kTetrahedron[] =
    "OFF\n4 4 0\n0 0 0\n2 0 0\n0 2 0\n0 0 2\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n";

TEST_F(SceneFiles, HaveMaterialsShapesMeshesAndCopies) {
  Write("tetra.off", kTetrahedron);
  auto description = Load(R"(
turntable = false
[material.clay]
diffuse = [0.6, 0.4, 0.3]
texture = { kind = "checker", size_m = 0.01, dark = 0.5 }
[material.foam]
kind = "medium"
mean_free_path_m = 0.002
albedo = [0.99, 0.98, 0.9]
anisotropy = 0.3
[material.ball]
kind = "glass"
ior = 1.6
[[mesh]]
file = "tetra.off"
material = "clay"
size_m = 0.1
position_m = [0.01, 0.02, 0.03]
[[mesh]]
file = "tetra.off"
material = "foam"
scale = 0.01
copy = [{ position_m = [0.2, 0, 0] }, { position_m = [-0.2, 0, 0], rotate_deg = [0, 0, 90] }]
[[ball]]
center_m = [0, 0, 0.3]
radius_m = 0.05
material = "ball"
[[box]]
center_m = [0, 0, -0.01]
size_m = [1, 2, 0.02]
material = "clay"
)");
  ASSERT_TRUE(description.ok()) << description.status();
  ASSERT_EQ(description->meshes.size(), 3u);
  const Mesh& mesh = description->meshes[0];
  Eigen::AlignedBox3f box;
  for (const Vec3f& v : mesh.vertices) box.extend(v);
  EXPECT_LT((box.min() - Vec3f(-0.04f, -0.03f, 0.03f)).norm(), 1e-6f)
      << "its middle over the position, standing on it";
  EXPECT_LT((box.sizes() - Vec3f(0.1f, 0.1f, 0.1f)).norm(), 1e-6f);
  EXPECT_EQ(description->meshes[1].placements.size(), 2u);
  const Material& foam = description->materials[description->meshes[1].material];
  EXPECT_EQ(foam.kind, Material::Kind::kMedium);
  EXPECT_FLOAT_EQ(foam.extinction, 500);
  EXPECT_FLOAT_EQ(foam.anisotropy, 0.3f);
  EXPECT_FLOAT_EQ(description->materials[description->balls.at(0).material].ior, 1.6f);
  auto texture = description->materials[mesh.material].texture;
  EXPECT_NE(texture({Vec3f(0.005f, 0.005f, 0.005f)}).x(),
            texture({Vec3f(0.015f, 0.005f, 0.005f)}).x());
  EXPECT_TRUE(Scene::Build(*std::move(description)).ok());
}

TEST_F(SceneFiles, SayWhereTheyAreWrong) {
  Write("tetra.off", kTetrahedron);
  const std::string clay = "[material.clay]\ndiffuse = [0.5, 0.5, 0.5]\n";
  ExpectRefused(clay + "shiny = 3\n", {"scene.toml:3:1", "shiny"});
  ExpectRefused("[material.clay]\ndiffuse = [0.5, 2, 0.5]\n", {"scene.toml:2", "diffuse"});
  ExpectRefused("[material.clay]\n", {"[material.clay]", "needs a colour"});
  ExpectRefused("[material.m]\nkind = \"velvet\"\n", {"velvet", "medium"});
  ExpectRefused("[material.m]\nkind = \"medium\"\n", {"mean_free_path_m"});
  ExpectRefused("[material.m]\nkind = \"mirror\"\nior = 2\n", {"ior"});
  ExpectRefused(clay + "[[ball]]\nradius_m = 0.1\nmaterial = \"wax\"\n",
                {"scene.toml:5", "[material.wax]", "clay"});
  ExpectRefused(clay + "[[ball]]\nmaterial = \"clay\"\n", {"radius_m"});
  ExpectRefused(clay + "[[mesh]]\nfile = \"missing.off\"\nmaterial = \"clay\"\n",
                {"scene.toml:4:1", "missing.off"});
  ExpectRefused(
      clay + "[[mesh]]\nfile = \"tetra.off\"\nmaterial = \"clay\"\nsize_m = 1\nscale = 2\n",
      {"scene.toml:7:1", "size_m or scale, not both"});
  ExpectRefused(clay + "[[mesh]]\nfile = \"scene.toml\"\nmaterial = \"clay\"\n",
                {".off, .obj, .ply"});
  ExpectRefused("[material.c]\ndiffuse = [1, 1, 1]\n[material.c.texture]\nfile = \"missing.png\"\n",
                {"scene.toml:4:1", "missing.png"});
  Write("bad.png", "no picture at all");
  ExpectRefused("[material.c]\ndiffuse = [1, 1, 1]\n[material.c.texture]\nfile = \"bad.png\"\n",
                {"bad.png", "no PNG"});
  ExpectRefused("this is no TOML", {"scene.toml:1"});
  auto nowhere = LoadScene("nowhere.toml", directory_.string());
  EXPECT_NE(nowhere.status().message().find("nowhere.toml"), std::string::npos) << nowhere.status();
}

TEST_F(SceneFiles, BadMeshesAreRefusedByFileAndElement) {
  auto with = [](const std::string& file, const std::string& material) {
    return "[material.m]\n" + material + "\n[[mesh]]\nfile = \"" + file +
           "\"\nmaterial = \"m\"\nsize_m = 0.1\n";
  };
  const std::string grey = "diffuse = [0.5, 0.5, 0.5]", glass = "kind = \"glass\"",
                    foam = "kind = \"medium\"\nmean_free_path_m = 0.01";
  Write("open.off", "OFF\n4 3 0\n0 0 0\n2 0 0\n0 2 0\n0 0 2\n3 0 2 1\n3 0 1 3\n3 0 3 2\n");
  EXPECT_TRUE(Load(with("open.off", grey)).ok());
  ExpectRefused(with("open.off", glass), {"open.off", "not closed", "triangle"});
  ExpectRefused(with("open.off", foam), {"open.off", "not closed", "triangle"});
  Write("nan.off",
        "OFF\n4 4 0\n0 0 0\n2 0 0\n0 nan 0\n0 0 2\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n");
  ExpectRefused(with("nan.off", grey), {"nan.off", "vertex"});
  Write("flat.off", "OFF\n4 2 0\n0 0 0\n1 0 0\n2 0 0\n0 1 0\n3 0 1 2\n3 0 1 3\n");
  ExpectRefused(with("flat.off", grey), {"flat.off", "no area"});
  Write("index.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n");
  ExpectRefused(with("index.off", grey), {"index.off"});
  Write("negative.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 -1\n");
  ExpectRefused(with("negative.off", grey), {"negative.off: line 6", "-1"});
  Write("few.off", "OFF\n3 9 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
  ExpectRefused(with("few.off", grey), {"few.off", "9 faces"});
  Write("many.off", "OFF\n400000000 1 0\n0 0 0\n");
  ExpectRefused(with("many.off", grey), {"many.off", "400000000"});
  Write("sum.off", "OFF\n18446744073709551615 1 0\n0 0 0\n");  // the sum would be 0
  ExpectRefused(with("sum.off", grey), {"sum.off: line 2", "18446744073709551615"});
  Write("long.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2" + std::string(5000, ' ') + "\n");
  ExpectRefused(with("long.off", grey), {"long.off: line 6", "longer"});
  const std::string ply =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float "
      "z\n";
  const std::string list =
      "property list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n";
  Write("corner.ply", ply + "element face 1\n" + list + "3 0 1 77\n");
  ExpectRefused(with("corner.ply", grey), {"corner.ply"});
  Write("few.ply", ply + "element face 5\n" + list + "3 0 1 2\n3 0 2 1\n");
  ExpectRefused(with("few.ply", grey), {"few.ply"});
  Write("noend.ply", ply);
  ExpectRefused(with("noend.ply", grey), {"noend.ply", "end_header"});
  Write("deep.gltf", std::string(200000, '['));
  ExpectRefused(with("deep.gltf", grey), {"deep.gltf"});
  Write("out.gltf",
        R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],
    "meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],
    "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}],
    "bufferViews":[{"buffer":0,"byteLength":36}],"buffers":[{"byteLength":36,"uri":"../../../../../../etc/passwd"}]})");
  ExpectRefused(with("out.gltf", grey), {"out.gltf"});
  // A buffer below the mesh is read, one that a link brings in from elsewhere is not.
  const float corners[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  const std::string bytes(reinterpret_cast<const char*>(corners), sizeof(corners));
  fs::create_directory(directory_ / "below");
  Write("below/real.bin", bytes);
  Write("elsewhere.bin", bytes);
  fs::create_symlink("../elsewhere.bin", directory_ / "below" / "link.bin");
  auto gltf = [&](const std::string& name, const std::string& buffer) {
    Write(name,
          R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],
    "meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],
    "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}],
    "bufferViews":[{"buffer":0,"byteLength":36}],"buffers":[{"byteLength":36,"uri":")" +
              buffer + R"("}]})");
    return with(name, grey);
  };
  EXPECT_TRUE(Load(gltf("below/real.gltf", "real.bin")).ok());
  ExpectRefused(gltf("below/link.gltf", "link.bin"), {"link.gltf"});
  Write("below/a b.bin", bytes);
  EXPECT_TRUE(Load(gltf("below/blank.gltf", "a%20b.bin")).ok());
  EXPECT_TRUE(Load(gltf("below/plain.gltf", "a b.bin")).ok());
  ExpectRefused(gltf("below/escaped.gltf", "%2e%2e/elsewhere.bin"), {"escaped.gltf"});
  // Larger than any memory, and nothing on the disk.
  Write("below/huge.bin", bytes);
  Write("huge.off", kTetrahedron);
  for (const char* huge : {"below/huge.bin", "huge.off"}) {
    fs::resize_file(directory_ / huge, uint64_t{1} << 40);
  }
  ExpectRefused(with("huge.off", grey), {"huge.off", "1 GiB"});
  ExpectRefused(gltf("below/huge.gltf", "huge.bin"), {"huge.gltf"});
  ExpectRefused(with("", grey), {"[mesh[0]] file"});
  ASSERT_EQ(mkfifo((directory_ / "pipe.off").c_str(), 0600), 0);
  ExpectRefused(with("pipe.off", grey), {"pipe.off"});
  Write("inside-out.off",
        "OFF\n4 4 0\n0 0 0\n2 0 0\n0 2 0\n0 0 2\n3 0 1 2\n3 0 3 1\n3 0 2 3\n3 1 3 2\n");
  EXPECT_TRUE(Load(with("inside-out.off", grey)).ok());
  ExpectRefused(with("inside-out.off", foam), {"inside-out.off", "inside out"});
  Write("against.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 -1\nf 1//1 2//1 3//1\n");
  ExpectRefused(with("against.obj", grey), {"against.obj", "other side"});
  Write("uv.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 1e37\nf 1/1 2/1 3/1\n");
  ExpectRefused(with("uv.obj", grey), {"uv.obj", "texture coordinates"});
  Write("short.off", "OFF\n4 4 0\n0 0 0\n2 0");
  ExpectRefused(with("short.off", grey), {"short.off"});
  Write("empty.ply", "");
  ExpectRefused(with("empty.ply", grey), {"empty.ply"});
  Write("points.ply",
        "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty "
        "float z\nend_header\n0 0 0\n1 1 1\n");
  ExpectRefused(with("points.ply", grey), {"points.ply"});
}

// What an importer would pass over or read as something else.
TEST_F(SceneFiles, MeshFilesThatWouldLoseFacesAreRefused) {
  auto refuse = [&](const std::string& file, const std::string& text,
                    const std::vector<std::string>& words) {
    Write(file, text);
    ExpectRefused("[material.m]\ndiffuse = [0.5, 0.5, 0.5]\n[[mesh]]\nfile = \"" + file +
                      "\"\nmaterial = \"m\"\nsize_m = 0.1\n",
                  words);
  };
  const std::string header = R"(ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
element face 4
property list uchar int vertex_indices
end_header
)";
  const std::string corners = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n", three = "3 0 2 1\n3 0 1 3\n3 1 2 3";
  const std::string vertices = header + corners;
  EXPECT_TRUE((Write("good.ply", vertices + "\n" + three + "\n3 0 3 2"),
               ReadMesh((directory_ / "good.ply").string(), Degrees(60)).ok()));
  refuse("short.ply", vertices + three, {"short.ply: line 16: truncated", "3 of 4 of face"});
  refuse("end.ply", vertices + three + "\n", {"end.ply: line 16: truncated"});
  refuse("middle.ply", vertices + three + "\n3 0",
         {"middle.ply: line 17", "2 values", "4 of a face"});
  refuse("blank.ply", vertices + "3 0 2 1\n\n3 0 1 3\n3 1 2 3\n", {"blank.ply: line 17"});
  refuse("two.ply", header + "0 0\n1 0 0\n0 1 0\n0 0 1\n" + three + "\n3 0 3 2\n",
         {"two.ply: line 10", "2 values, must have 3 of a vertex"});
  refuse("many.ply", header + "0 0 0 1 0 0\n0 1 0 0 0 1\n" + three + "\n3 0 3 2\n\n\n\n",
         {"many.ply: line 10", "6 values"});
  refuse("word.ply", header + "0 0 x\n1 0 0\n0 1 0\n0 0 1\n" + three + "\n3 0 3 2\n",
         {"word.ply: line 10", "'x'"});
  refuse("more.ply", vertices + three + "\n3 0 3 2\n3 0 1 2\n", {"more.ply: line 18", "more than"});
  refuse("edge.ply", vertices + "2 1 2\n" + three, {"edge.ply: line 14", "2 corners"});
  refuse("index.ply", vertices + "3 0 1 9\n" + three, {"index.ply: line 14", "corner 9"});
  refuse("type.ply", "ply\nelement vertex 1\nproperty real x\nend_header\n", {"type.ply: line 3"});

  // The same in bytes.
  std::string binary = header;
  binary.replace(binary.find("ascii"), 5, "binary_little_endian");
  const float places[12] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
  binary.append(reinterpret_cast<const char*>(places), sizeof(places));
  for (const std::array<int, 3>& face : {std::array{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}}) {
    binary += '\3';
    binary.append(reinterpret_cast<const char*>(face.data()), sizeof(face));
  }
  Write("bytes.ply", binary);
  EXPECT_TRUE(ReadMesh((directory_ / "bytes.ply").string(), Degrees(60)).ok());
  refuse("none.ply", binary.substr(0, binary.find("header\n") + 7),
         {"none.ply: truncated", "vertex 0 of 4"});
  refuse("cut.ply", binary.substr(0, binary.size() - 5), {"cut.ply: truncated", "face 3 of 4"});
  refuse("rest.ply", binary + "rest", {"rest.ply", "4 bytes more"});

  const std::string points = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n";
  EXPECT_TRUE((Write("good.obj", points + "f 1 3 2 \\\n 4\nvn 0 0 1\nf -4//-1 2//1 3//1\nl 1 2\n"),
               ReadMesh((directory_ / "good.obj").string(), Degrees(60)).ok()));
  refuse("cut.obj", points + "f 1 3 2\nf 1 4", {"cut.obj: line 6", "2 corners"});
  refuse("few.obj", points + "f 1 3 2\nf\nf 1 2 4", {"few.obj: line 6", "0 corners"});
  refuse("index.obj", points + "f 1 3 2\nf 2 3 9\nf 1 4 3\n", {"index.obj: line 6", "vertex 9"});
  refuse("below.obj", points + "f 1 3 -5\n", {"below.obj: line 5", "vertex -5"});
  refuse("zero.obj", points + "f 0 3 2\n", {"zero.obj: line 5", "'0'"});
  refuse("word.obj", points + "f x y z\n", {"word.obj: line 5", "'x'"});
  refuse("normal.obj", points + "vn 0 0 1\nf 1//7 3//1 2//1\n", {"normal.obj: line 6", "normal 7"});
  refuse("uv.obj", points + "vt 0 0\nf 1/9 3/1 2/1\n", {"uv.obj: line 6", "texture coordinate 9"});

  refuse("indented.obj", points + "f 1 3 2\n f 1 2 4\n", {"indented.obj", "has 2 faces; 1 could"});
  refuse("edge.off", "OFF\n4 2 0\n" + corners + "3 0 2 1\n2 1 2\n",
         {"edge.off: line 8", "2 corners"});

  // A tetrahedron's faces, of which one refers to vertex 9, or `vertices` and `indices` are too few.
  auto gltf = [](int vertices, int indices, const char* last) {
    return absl::StrCat(
        R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],
    "meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1}]}],
    "accessors":[{"bufferView":0,"componentType":5126,"count":)",
        vertices, R"(,"type":"VEC3"},{"bufferView":1,"componentType":5123,"count":)", indices,
        R"(,"type":"SCALAR"}],
    "bufferViews":[{"buffer":0,"byteLength":48},{"buffer":0,"byteOffset":48,"byteLength":24}],
    "buffers":[{"byteLength":72,"uri":"data:application/octet-stream;base64,)",
        "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAAAAAAAAAAAAIA/AAACAAEAAAABAAMAAQACA",
        last, R"("}]})");
  };
  Write("good.gltf", gltf(4, 12, "AMAAAADAAIA"));
  EXPECT_TRUE(ReadMesh((directory_ / "good.gltf").string(), Degrees(60)).ok());
  refuse("index.gltf", gltf(4, 12, "AkAAAADAAIA"), {"index.gltf", "out-of-range"});
  refuse("vertices.gltf", gltf(3, 12, "AMAAAADAAIA"), {"vertices.gltf", "out-of-range"});
  refuse("indices.gltf", gltf(4, 11, "AMAAAADAAIA"), {"indices.gltf", "dropped"});
}

// One quad in every format, with texture coordinates where the format has them.
TEST_F(SceneFiles, MeshesComeInFourFormats) {
  Write("q.off", "OFF\n4 1 0\n0 0 0\n1 0 0\n1 0 1\n0 0 1\n4 0 1 2 3\n");
  Write("q.obj",
        "v 0 0 0\nv 1 0 0\nv 1 0 1\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n");
  Write("q.ply",
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty "
        "float z\nelement face 1\n"
        "property list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n1 0 1\n0 0 1\n4 0 1 2 "
        "3\n");
  // Positions of the same quad with +Y up, then indices 0 1 2 0 2 3, as base64.
  Write("q.gltf",
        R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],
    "meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1}]}],
    "accessors":[{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3","min":[0,0,0],"max":[1,1,0]},
                 {"bufferView":1,"componentType":5123,"count":6,"type":"SCALAR"}],
    "bufferViews":[{"buffer":0,"byteOffset":0,"byteLength":48},{"buffer":0,"byteOffset":48,"byteLength":12}],
    "buffers":[{"byteLength":60,"uri":"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAACAPwAAgD8AAAAAAAAAAAAAgD8AAAAAAAABAAIAAAACAAMA"}]})");
  for (const char* name : {"q.off", "q.obj", "q.ply", "q.gltf"}) {
    auto mesh = ReadMesh((directory_ / name).string(), Degrees(60));
    ASSERT_TRUE(mesh.ok()) << mesh.status();
    EXPECT_EQ(mesh->triangles.size(), 2u) << name;
    Eigen::AlignedBox3f box;
    for (const Vec3f& v : mesh->vertices) box.extend(v);
    EXPECT_LT((box.sizes() - Vec3f(1, 0, 1)).norm(), 1e-6f) << name;
    for (const Vec3f& n : mesh->normals)
      EXPECT_LT((n - Vec3f(0, -1, 0)).norm(), 1e-6f) << name << " " << n.transpose();
    EXPECT_EQ(mesh->uvs.empty(), std::string(name) != "q.obj") << name;
  }
  auto mesh = ReadMesh((directory_ / "q.obj").string(), Degrees(60));
  for (size_t i = 0; i < mesh->vertices.size(); ++i) {
    EXPECT_LT((mesh->uvs[i] - Vec2f(mesh->vertices[i].x(), mesh->vertices[i].z())).norm(), 1e-6f);
  }
}

TEST(Texture, IsBilinearAndRepeats) {
  Image picture(2, 2, 3);
  picture.at(0, 1, 0) = 1;  // lower left is red
  picture.at(1, 0, 1) = 1;  // upper right is green
  EXPECT_LT((Lookup(picture, {0.25f, 0.25f}) - Rgb(1, 0, 0)).abs().maxCoeff(), 1e-6f);
  EXPECT_LT((Lookup(picture, {0.75f, 0.75f}) - Rgb(0, 1, 0)).abs().maxCoeff(), 1e-6f);
  EXPECT_LT((Lookup(picture, {0.5f, 0.5f}) - Rgb(0.25f, 0.25f, 0)).abs().maxCoeff(), 1e-6f);
  EXPECT_LT((Lookup(picture, {3.25f, -4.75f}) - Rgb(1, 0, 0)).abs().maxCoeff(), 1e-6f);
}

// ---- Meshes that others made

TEST_F(SceneFiles, TakesTheMeshesOfLibcgalDemo) {
  const std::string archive = "/usr/share/doc/libcgal-dev/data.tar.gz";
  ASSERT_TRUE(fs::exists(archive)) << "install Debian's libcgal-demo";
  ASSERT_EQ(
      std::system(("tar -xzf " + archive + " -C " + directory_.string() + " data/meshes").c_str()),
      0);
  int rendered = 0, refused = 0;
  for (const fs::directory_entry& entry : fs::directory_iterator(directory_ / "data/meshes")) {
    const std::string extension = entry.path().extension().string();
    if (extension != ".off" && extension != ".ply") continue;
    auto description =
        Load("[material.m]\ndiffuse = [0.7, 0.6, 0.5]\n[[mesh]]\nfile = \"data/meshes/" +
             entry.path().filename().string() + "\"\nmaterial = \"m\"\nsize_m = 0.18\n");
    absl::Status status = description.status();
    if (status.ok()) {
      auto scene = Scene::Build(*std::move(description));
      status = scene.status();
      if (scene.ok()) {
        const Image image = Look(*scene);
        EXPECT_GT(Mean(image), 1e-3) << entry.path();
        for (float v : image.pixels()) ASSERT_TRUE(std::isfinite(v)) << entry.path();
        ++rendered;
        continue;
      }
    }
    ++refused;
    EXPECT_NE(status.message().find(entry.path().filename().string()), std::string::npos) << status;
  }
  EXPECT_GT(rendered, 120);
  EXPECT_LT(refused, 20);
}

// ---- The shipped scenes

TEST(Scenes, UnknownNameIsExplained) {
  auto scene = LoadScene("teapot", "");
  EXPECT_EQ(scene.status().code(), absl::StatusCode::kNotFound);
  EXPECT_NE(scene.status().message().find("default"), std::string::npos);
}

// Normals outward: seen from outside, every surface faces the viewer with its own side. A room's walls are seen from within.
TEST(Scenes, MeshesFaceOutward) {
  for (const ShippedScene& scene : ShippedScenes()) {
    auto description = LoadScene(scene.name, "");
    ASSERT_TRUE(description.ok());
    for (size_t i = 0; i < description->meshes.size(); ++i) {
      const Mesh& mesh = description->meshes[i];
      SCOPED_TRACE(absl::StrCat(scene.name, ", mesh ", i));
      if (mesh.triangles.size() == 2) continue;  // the floor
      double volume = 0;
      int against = 0;
      for (const auto& t : mesh.triangles) {
        const Vec3f &a = mesh.vertices[t[0]], &b = mesh.vertices[t[1]], &c = mesh.vertices[t[2]];
        volume += a.cross(b).dot(c) / 6;
        against += (b - a).cross(c - a).dot(mesh.normals[t[0]]) < 0;
      }
      EXPECT_GT(mesh.name == "walls" ? -volume : volume, 0);
      EXPECT_LT(against, static_cast<int>(mesh.triangles.size() / 50 + 1));
    }
  }
}

TEST_F(SceneFiles, MediaThatOverlapAreRefused) {
  Write("tetra.off", kTetrahedron);
  const std::string materials =
      "turntable = false\n[material.foam]\nkind = \"medium\"\nmean_free_path_m = 0.02\n"
      "[material.milk]\nkind = \"medium\"\nmean_free_path_m = 0.01\n"
      "[material.glass]\nkind = \"glass\"\n[material.clay]\ndiffuse = [0.5, 0.5, 0.5]\n";
  auto ball = [](const char* material, double x, double radius) {
    return absl::StrCat("[[ball]]\ncenter_m = [", x, ", 0, 0.1]\nradius_m = ", radius,
                        "\nmaterial = \"", material, "\"\n");
  };
  auto box = [](const char* material, double x) {
    return absl::StrCat("[[box]]\ncenter_m = [", x,
                        ", 0, 0.1]\nsize_m = [0.1, 0.1, 0.1]\nmaterial = \"", material, "\"\n");
  };
  const std::string foam = materials + ball("foam", 0, 0.1);
  ExpectRefused(foam + ball("foam", 0, 0.07), {"ball 0 and ball 1 overlap"});
  ExpectRefused(foam + ball("milk", 0, 0.1), {"ball 0 and ball 1 overlap"});
  ExpectRefused(foam + ball("glass", 0.02, 0.03), {"ball 0 and ball 1 overlap"});
  ExpectRefused(foam + ball("foam", 0.12, 0.1), {"ball 0 and ball 1 overlap"});
  ExpectRefused(materials + box("foam", 0) + box("milk", 0.05), {"box 0 and box 1 overlap"});
  ExpectRefused(materials +
                    "[[mesh]]\nfile = \"tetra.off\"\nmaterial = \"foam\"\nsize_m = 0.1\n"
                    "[[mesh.copy]]\n[[mesh.copy]]\nposition_m = [0.01, 0, 0]\n",
                {"tetra.off and ", "tetra.off overlap"});
  ExpectRefused(foam + ball("foam", 0.2, 0.1), {"ball 0 and ball 1", "touch", "leave a gap"});
  ExpectRefused(foam + box("milk", 0.15), {"ball 0 and box 0", "leave a gap"});
  for (const std::string& good : {ball("clay", 0.02, 0.03), ball("foam", 0.201, 0.1),
                                  box("milk", 0.151), ball("glass", 0.25, 0.1)}) {
    auto description = Load(foam + good);
    ASSERT_TRUE(description.ok()) << description.status();
    const absl::Status built = Scene::Build(*std::move(description)).status();
    EXPECT_TRUE(built.ok()) << good << built;
  }
}

// What paths take is known before they are traced, also of narrow pictures and of media, where paths are long.
TEST(Scenes, PathsTakeTheMemoryThatWasEstimated) {
  auto scene = Scene::Build(*LoadScene("materials", ""));
  ASSERT_TRUE(scene.ok());
  const CameraGeometry camera{Vec3(0, -1.1, 0.55), Vec3(0, 0, 0.075), Degrees(17)};
  const PathOptions options{.samples = 2, .bounces = 1000};
  for (const auto& [width, height] :
       {std::pair(160, 120), std::pair(800, 10), std::pair(10, 300)}) {
    size_t vertices = 0;
    const Paths paths(*scene, camera, width, height, options);
    for (const Paths::Block& block : paths.blocks()) vertices += block.first.back();
    const auto taken = static_cast<double>(vertices * kVertexFloats * sizeof(float));
    const auto estimated =
        static_cast<double>(EstimatePathBytes(*scene, camera, width, height, options));
    EXPECT_GT(estimated / taken, 0.7) << width << "x" << height;
    EXPECT_LT(estimated / taken, 1.4) << width << "x" << height;
  }
}

// They build, stay modest, and something is to be seen.
TEST(Scenes, ShippedOnesAreSoundAndLit) {
  for (const ShippedScene& shipped : ShippedScenes()) {
    auto description = LoadScene(shipped.name, "");
    ASSERT_TRUE(description.ok()) << shipped.name;
    size_t triangles = 0;
    for (const Mesh& mesh : description->meshes) triangles += mesh.triangles.size();
    EXPECT_LT(triangles, 600000u) << shipped.name;
    auto scene = Scene::Build(*std::move(description));
    ASSERT_TRUE(scene.ok()) << shipped.name << ": " << scene.status();
    EXPECT_GT(Mean(Look(*scene)), 0.02) << shipped.name;
  }
}

}  // namespace
}  // namespace lightstage::sim
