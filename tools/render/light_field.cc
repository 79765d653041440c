#include "tools/render/light_field.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <span>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "base/env.h"
#include "base/status.h"
#include "base/toml.h"
#include "dataset/exr.h"

namespace lightstage::sim {
namespace {

Vec3 ToVec(const std::vector<double>& v) {
  return v.size() == 3 ? Vec3(v[0], v[1], v[2]) : Vec3::Zero();
}

}  // namespace

absl::StatusOr<EnvironmentMap> ReadEnvironmentMap(const std::string& file) {
  ASSIGN_OR_RETURN(const Image picture, ReadExr(file));
  // The picture's pixels, sums of what comes from the map, must be numbers that its file can hold.
  constexpr float kBrightest = 1e30f;
  const std::span<const float> values = picture.pixels();
  const auto bright =
      std::find_if(values.begin(), values.end(), [](float v) { return v > kBrightest; });
  if (bright != values.end() && std::isfinite(*bright)) {
    const auto pixel = static_cast<int>((bright - values.begin()) / picture.channels());
    return Error(
        absl::StatusCode::kInvalidArgument, "ENVIRONMENT_INVALID",
        absl::StrFormat("%s: pixel (%d, %d) is %g W/(m²·sr); at most %g can be rendered", file,
                        pixel % picture.width(), pixel / picture.width(), *bright, kBrightest));
  }
  auto map = EnvironmentMap::FromImage(picture);
  if (!map.ok()) return Annotate(map.status(), file);
  return map;
}

absl::StatusOr<IncidentLightField> ReadLightField(const std::string& directory) {
  const std::filesystem::path folder(directory);
  const std::string index = (folder / "light_field.toml").string();
  ASSIGN_OR_RETURN(std::string text, ReadNamedFile(index, PosixEnv()));
  ASSIGN_OR_RETURN(TomlDocument document, TomlDocument::Parse(text, index));
  const TomlTable& table = document.root();
  const int columns = static_cast<int>(table.Int("columns", 1, 64)),
            rows = static_cast<int>(table.Int("rows", 1, 64));
  const Vec3 origin = ToVec(table.Doubles("origin_m", -100, 100, 3)),
             u = ToVec(table.Doubles("u_m", -100, 100, 3)),
             v = ToVec(table.Doubles("v_m", -100, 100, 3));
  if (table.Has("v_m") && u.cross(v).norm() < 1e-9)
    table.ErrorAt("v_m", "must not be parallel to u_m, nor either of them 0");
  RETURN_IF_ERROR(document.Finish());
  std::vector<EnvironmentMap> maps;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const std::string file = (folder / absl::StrCat(row, "-", column, ".exr")).string();
      ASSIGN_OR_RETURN(EnvironmentMap map, ReadEnvironmentMap(file));
      if (!maps.empty() &&
          (map.width() != maps.front().width() || map.height() != maps.front().height())) {
        return Error(
            absl::StatusCode::kInvalidArgument, "LIGHT_FIELD",
            absl::StrCat(file, ": is ", map.width(), " x ", map.height(), " pixels, must be ",
                         maps.front().width(), " x ", maps.front().height(), " like 0-0.exr"));
      }
      const double bytes = 12.0 * map.width() * map.height() * columns * rows;
      if (constexpr double kMostBytes = 2e9; bytes > kMostBytes) {
        return Error(
            absl::StatusCode::kResourceExhausted, "MEMORY",
            absl::StrFormat("%s: %d x %d maps like %s take %.1f GB, at most %.1f GB are used",
                            directory, columns, rows, file, bytes / 1e9, kMostBytes / 1e9));
      }
      maps.push_back(std::move(map));
    }
  }
  IncidentLightField field(std::move(maps), columns, rows, origin, u, v);
  if (field.IsBlack()) {
    return Error(absl::StatusCode::kInvalidArgument, "ENVIRONMENT_BLACK",
                 absl::StrCat(directory, ": all maps are black: no pixel is above 0"));
  }
  return field;
}

}  // namespace lightstage::sim
