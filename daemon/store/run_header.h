// What is known about a run before its first shot: run.json, written once and never changed.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "optics/rig_geometry.h"

namespace lightstage {

struct RunHeader {
  std::string id;          // its folder's name; given by DataDirectory::CreateRun
  std::string name;        // given by the user; empty: the id
  std::string created_at;  // RFC 3339, UTC (base/clock.h FormatUtc)
  std::string rig_name;
  RigGeometry geometry;
  std::string plan_json;  // the resolved plan as the API's canonical JSON; opaque to the store
  int width = 0, height = 0, channels = 0;  // of every basis image
  std::string compression;
  uint64_t expected_shots = 0;  // dark and reference shots included
};

// INVALID_ARGUMENT if plan_json is not JSON.
absl::StatusOr<std::string> RunHeaderToJson(const RunHeader& header);
// DATA_LOSS / RUN_FILE_CORRUPT naming `name` and the place.
absl::StatusOr<RunHeader> RunHeaderFromJson(std::string_view text, std::string_view name);

}  // namespace lightstage
