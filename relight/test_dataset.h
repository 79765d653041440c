// A small synthetic capture on disk, for tests: a Lambert sphere seen by a parallel camera along −X, lit by distant lamps.
#pragma once

#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "dataset/basis_exr.h"
#include "dataset/manifest.h"
#include "gtest/gtest.h"

namespace lightstage::relight {

inline constexpr int kSphereSize = 32;

// A folder of the running test's own, empty.
inline std::string TestFolder() {
  const auto* info = testing::UnitTest::GetInstance()->current_test_info();
  auto path = std::filesystem::path(testing::TempDir()) /
              absl::StrCat("relight-", info->test_suite_name(), "-", info->name());
  std::filesystem::remove_all(path);
  std::filesystem::create_directories(path);
  return path.string();
}

// The sphere's normal at a pixel's centre; zero outside its disc. The camera stands on +X: +Y is right, +Z up.
inline Vec3 SphereNormal(int x, int y) {
  const double py = 2 * (x + 0.5) / kSphereSize - 1, pz = 1 - 2 * (y + 0.5) / kSphereSize;
  const double r = py * py + pz * pz;
  if (r >= 1) return Vec3::Zero();
  return {std::sqrt(1 - r), py, pz};
}

// The basis image under a lamp that makes irradiance `level` on a surface facing it, with albedo/π = `colour`.
inline BasisImage SphereImage(const Vec3& light, double level, const std::vector<float>& colour) {
  const int channels = static_cast<int>(colour.size());
  BasisImage out{Image(kSphereSize, kSphereSize, channels),
                 std::vector<uint8_t>(kSphereSize * kSphereSize)};
  for (int y = 0; y < kSphereSize; ++y) {
    for (int x = 0; x < kSphereSize; ++x) {
      const double cosine = std::max(0.0, SphereNormal(x, y).dot(light));
      for (int c = 0; c < channels; ++c) out.pixels.at(x, y, c) = level * cosine * colour[c];
      if (cosine == 0) out.flags[y * kSphereSize + x] = kBelowRange;
    }
  }
  return out;
}

inline ShotRecord SphereRecord(uint64_t id, std::optional<Vec3> direction, double level = 1) {
  ShotRecord record;
  record.shot.id = id;
  record.shot.condition.lamps = {{0, level}};
  record.shot.exposures = {std::chrono::milliseconds(1)};
  record.direction = direction;
  record.captured_at = "2024-01-01T00:00:00Z";
  record.exposures.resize(1);
  record.file = absl::StrCat("basis_", id, ".exr");
  record.sha256 = std::string(64, '0');
  return record;
}

// Azimuths × tilts, cell-centred in tilt, as the light stage takes them.
inline std::vector<Vec3> StageDirections(int azimuths, int tilts) {
  std::vector<Vec3> out;
  for (int a = 0; a < azimuths; ++a) {
    for (int t = 0; t < tilts; ++t) {
      out.push_back(
          DirectionFromAngles(Degrees(360.0 * a / azimuths), Degrees(90 * (t + 0.5) / tilts)));
    }
  }
  return out;
}

// Not through Env: hundreds of synced files would take seconds.
inline void WriteText(const std::string& path, const std::string& bytes) {
  std::ofstream out(path, std::ios::binary);
  out << bytes;
  ASSERT_TRUE(out.good()) << path;
}

inline void WriteImage(const std::string& folder, const ShotRecord& record,
                       const BasisImage& image) {
  FrameAttributes attributes;
  attributes.shot = record.shot;
  attributes.direction = record.direction;
  attributes.exposures_s = {0.001};
  attributes.captured_at = record.captured_at;
  auto bytes = EncodeBasisExr(image, attributes, ExrCompression::kNone);
  ASSERT_TRUE(bytes.ok()) << bytes.status();
  WriteText(absl::StrCat(folder, "/", record.file), *bytes);
}

inline void WriteManifest(const std::string& folder, const std::vector<ShotRecord>& records,
                          int channels) {
  Manifest manifest;
  manifest.run_id = "runs/test";
  manifest.name = "sphere";
  manifest.rig_name = "test";
  manifest.created_at = "2024-01-01T00:00:00Z";
  manifest.plan_json = "{}";
  manifest.width = manifest.height = kSphereSize;
  manifest.channels = channels;
  manifest.compression = "none";
  manifest.geometry.brace.radius = Meters(1);
  manifest.geometry.brace.lamp_radius = Meters(0.02);
  manifest.geometry.brace.lamps = {{Degrees(0), Degrees(45)}};
  manifest.geometry.camera.position = {2, 0, 0};
  manifest.geometry.camera.field_of_view = Degrees(30);
  manifest.shots = records;
  auto json = ManifestToJson(manifest);
  ASSERT_TRUE(json.ok()) << json.status();
  WriteText(absl::StrCat(folder, "/", kManifestFile), *json);
}

// A whole capture: one basis image per direction.
inline void WriteSphere(const std::string& folder, const std::vector<Vec3>& directions,
                        const std::vector<float>& colour) {
  std::vector<ShotRecord> records;
  for (const Vec3& d : directions) {
    records.push_back(SphereRecord(records.size(), d));
    WriteImage(folder, records.back(), SphereImage(d, 1, colour));
  }
  WriteManifest(folder, records, static_cast<int>(colour.size()));
}

}  // namespace lightstage::relight
