#include "drivers/display/colour_blobs.h"

#include <cstring>
#include <vector>

namespace lightstage {

bool IsStraight(std::span<const ColourEntry> table) {
  if (table.size() < 2) return false;
  for (size_t i = 0; i < table.size(); ++i) {
    const size_t last = table.size() - 1;
    for (size_t c = 0; c < 3; ++c) {
      if (table[i][c] < 65280 * i / last || table[i][c] > (65535 * i + last - 1) / last)
        return false;
    }
  }
  return true;
}

bool IsStraightBlob(std::span<const std::byte> blob) {
  std::vector<ColourEntry> table(blob.size() / sizeof(ColourEntry));
  if (table.empty()) return false;
  std::memcpy(table.data(), blob.data(), table.size() * sizeof(ColourEntry));
  return IsStraight(table);
}

bool IsIdentityBlob(std::span<const std::byte> blob) {
  uint64_t matrix[9];  // S31.32, by rows
  if (blob.size() != sizeof matrix) return false;
  std::memcpy(matrix, blob.data(), sizeof matrix);
  for (size_t i = 0; i < 9; ++i) {
    if (matrix[i] != (i % 4 == 0 ? uint64_t{1} << 32 : 0)) return false;
  }
  return true;
}

}  // namespace lightstage
