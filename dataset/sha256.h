// The checksum that stands beside every file of a dataset.
#pragma once

#include <string>
#include <string_view>

namespace lightstage {

// Lower-case hex, 64 characters.
std::string Sha256Hex(std::string_view bytes);

}  // namespace lightstage
