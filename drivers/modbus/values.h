// Numbers in 16-bit registers. The Modbus application protocol (V1.1b3, 4.2) fixes the order of a register's bytes, not the order of the
// registers that a longer number takes: that is each maker's choice.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace lightstage {

enum class WordOrder { kHighFirst, kLowFirst };

struct NumberFormat {
  int words = 1;  // 1 or 2
  WordOrder order = WordOrder::kHighFirst;
  bool is_signed = false;  // two's complement
};

// The range of a format's numbers.
int64_t Lowest(const NumberFormat& format);
int64_t Highest(const NumberFormat& format);

// Nothing if `words` are not as many as the format has.
std::optional<int64_t> DecodeNumber(const NumberFormat& format, std::span<const uint16_t> words);
// Nothing if `value` is out of the format's range.
std::optional<std::vector<uint16_t>> EncodeNumber(const NumberFormat& format, int64_t value);

}  // namespace lightstage
