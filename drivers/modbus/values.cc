#include "drivers/modbus/values.h"

namespace lightstage {

int64_t Lowest(const NumberFormat& format) {
  if (!format.is_signed) return 0;
  return format.words == 1 ? INT16_MIN : INT32_MIN;
}

int64_t Highest(const NumberFormat& format) {
  if (format.is_signed) return format.words == 1 ? INT16_MAX : INT32_MAX;
  return format.words == 1 ? UINT16_MAX : UINT32_MAX;
}

std::optional<int64_t> DecodeNumber(const NumberFormat& format, std::span<const uint16_t> words) {
  if (static_cast<int>(words.size()) != format.words) return std::nullopt;
  if (format.words == 1) {
    return format.is_signed ? int64_t{static_cast<int16_t>(words[0])} : int64_t{words[0]};
  }
  const bool high_first = format.order == WordOrder::kHighFirst;
  const uint32_t value = uint32_t{words[high_first ? 0 : 1]} << 16 | words[high_first ? 1 : 0];
  return format.is_signed ? int64_t{static_cast<int32_t>(value)} : int64_t{value};
}

std::optional<std::vector<uint16_t>> EncodeNumber(const NumberFormat& format, int64_t value) {
  if (value < Lowest(format) || value > Highest(format)) return std::nullopt;
  const auto bits = static_cast<uint32_t>(value);
  const auto low = static_cast<uint16_t>(bits), high = static_cast<uint16_t>(bits >> 16);
  if (format.words == 1) return std::vector<uint16_t>{low};
  if (format.order == WordOrder::kHighFirst) return std::vector<uint16_t>{high, low};
  return std::vector<uint16_t>{low, high};
}

}  // namespace lightstage
