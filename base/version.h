#pragma once

namespace lightstage {
inline constexpr char kVersion[] = LIGHTSTAGE_VERSION;  // of the project, from CMakeLists.txt
}
