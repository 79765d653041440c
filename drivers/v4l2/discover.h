// Cameras of this machine, for the rig file.
#pragma once

#include <string_view>
#include <vector>

#include "drivers/api/registry.h"
#include "drivers/v4l2/video_device.h"

namespace lightstage {

// Every node that captures. A node that could not be looked at is an entry that says why; an error if there is no other.
absl::StatusOr<std::vector<Discovered>> DiscoverVideo(VideoSystem& system);

// As a TOML basic string, quotes included.
std::string TomlString(std::string_view text);

}  // namespace lightstage
