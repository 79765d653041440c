// The rig file's [geometry] tables.
#pragma once

#include "base/toml.h"
#include "optics/rig_geometry.h"

namespace lightstage {

constexpr int kMostLamps = 1024;  // on one brace

// Errors go into the table.
RigGeometry ParseGeometry(const TomlTable& geometry);

}  // namespace lightstage
