// The importers believe what a file says of itself, and pass over what they cannot use. What they stumble over or would leave out is
// looked for first.
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace lightstage::sim {

// INVALID_ARGUMENT / MESH. All of the below say the line, or the element of a binary file.
absl::Status WrongMesh(const std::string& path, const std::string& why);

// One element per line, as many as announced, and every face has three corners or more, that there are.
absl::Status CheckOff(const std::string& path, const std::string& bytes);

// Every corner of a face is a vertex that there is, and so are its texture coordinates and its normal. Returns how many faces.
absl::StatusOr<uint64_t> CheckObj(const std::string& path, const std::string& bytes);

// As many elements as the header announces and no more of them than the file can hold; each with all its values. Returns how many faces.
absl::StatusOr<uint64_t> CheckPly(const std::string& path, const std::string& bytes);

}  // namespace lightstage::sim
