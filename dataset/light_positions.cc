#include "dataset/light_positions.h"

#include <algorithm>

#include "absl/strings/numbers.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"
#include "base/status.h"

namespace lightstage {

Vec3 ToCameraAxes(const Vec3& direction, const CameraGeometry& camera) {
  ViewFrame frame = CameraFrame(camera);
  return {direction.dot(frame.right), -direction.dot(frame.down), -direction.dot(frame.forward)};
}

std::string LightFileName(size_t index) { return absl::StrFormat("lights_%03d.lp", index); }

std::vector<std::string> WriteLightPositions(const std::vector<ShotRecord>& shots,
                                             const CameraGeometry& camera) {
  std::vector<std::string> lines;
  for (const ShotRecord& record : shots) {
    if (record.shot.kind != ShotKind::kBasis || !record.direction) continue;
    // Adding 0 turns −0 into 0.
    Vec3 d = ((ToCameraAxes(*record.direction, camera) * 1e8).array().round() / 1e8 + 0.0).matrix();
    lines.push_back(absl::StrFormat("%s %.8f %.8f %.8f\n", record.file, d.x(), d.y(), d.z()));
  }
  std::vector<std::string> files;
  for (size_t begin = 0; begin < lines.size(); begin += kMostLightsPerFile) {
    size_t end = std::min(begin + kMostLightsPerFile, lines.size());
    std::string text = absl::StrCat(end - begin, "\n");
    for (size_t i = begin; i < end; ++i) text += lines[i];
    files.push_back(std::move(text));
  }
  return files;
}

absl::StatusOr<std::vector<LightPosition>> ParseLightPositions(std::string_view text,
                                                               std::string_view name) {
  auto corrupt = [&](size_t line, std::string_view why) {
    std::string where = absl::StrCat(name, ":", line);
    return Error(absl::StatusCode::kDataLoss, "LIGHT_POSITIONS_CORRUPT",
                 absl::StrCat(where, ": ", why), {{"where", where}});
  };
  std::vector<std::string> lines = absl::StrSplit(AbslView(text), '\n');
  if (!lines.empty() && lines.back().empty()) lines.pop_back();
  size_t count = 0;
  if (lines.empty() || !absl::SimpleAtoi(lines[0], &count)) {
    return corrupt(1, "must be the number of lights");
  }
  if (count != lines.size() - 1) {
    return corrupt(1, absl::StrCat("says ", count, " lights, but ", lines.size() - 1, " follow"));
  }
  std::vector<LightPosition> lights;
  for (size_t i = 1; i < lines.size(); ++i) {
    std::vector<std::string> fields = absl::StrSplit(lines[i], ' ');
    LightPosition light;
    if (fields.size() != 4 || !absl::SimpleAtod(fields[1], &light.direction.x()) ||
        !absl::SimpleAtod(fields[2], &light.direction.y()) ||
        !absl::SimpleAtod(fields[3], &light.direction.z())) {
      return corrupt(i + 1, "must be 'filename x y z'");
    }
    light.file = fields[0];
    lights.push_back(std::move(light));
  }
  return lights;
}

}  // namespace lightstage
