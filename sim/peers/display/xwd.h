// An XWD file (X Window Dump, version 7; X11/XWDFile.h), as Xvfb keeps its frame buffer in with -fbdir.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "absl/status/statusor.h"

namespace lightstage {

struct XwdPicture {
  int width = 0, height = 0;
  std::vector<uint32_t> pixels;  // 0x00RRGGBB, top row first
};

// INVALID_ARGUMENT / XWD unless it is a whole picture of 32 bits a pixel with eight a channel.
absl::StatusOr<XwdPicture> ParseXwd(std::span<const uint8_t> file);

}  // namespace lightstage
