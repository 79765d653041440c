// What the fuzzers share. Each source defines LLVMFuzzerTestOneInput, which libFuzzer (scripts/fuzz) or replay_main.cc calls. It does
// more than call a decoder: it holds it to what its header promises.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <span>
#include <string_view>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size);

// Ends the process if a promise is broken, which libFuzzer takes for a finding.
#define HOLDS(condition)                                                                  \
  do {                                                                                    \
    if (!(condition)) {                                                                   \
      std::fprintf(stderr, "%s:%d: does not hold: %s\n", __FILE__, __LINE__, #condition); \
      std::abort();                                                                       \
    }                                                                                     \
  } while (false)

namespace lightstage::fuzz {

// The fuzzer's bytes, taken from the front; zeros when there are no more.
class Input {
 public:
  Input(const uint8_t* data, size_t size) : bytes_(data, size) {}

  uint8_t Byte() {
    if (bytes_.empty()) return 0;
    const uint8_t byte = bytes_.front();
    bytes_ = bytes_.subspan(1);
    return byte;
  }
  // Which of `count` things to do: a digit, so that seeds can be written by hand.
  unsigned Choice(unsigned count) { return static_cast<uint8_t>(Byte() - '0') % count; }
  uint16_t Word() {
    const uint8_t low = Byte();
    return static_cast<uint16_t>(low | Byte() << 8);
  }
  uint32_t Long() {
    const uint32_t low = Word();
    return low | static_cast<uint32_t>(Word()) << 16;
  }
  // Memory of its own, so that a sanitizer sees a byte too many.
  std::vector<uint8_t> Take(size_t count) {
    const std::span<const uint8_t> taken = bytes_.first(count < size() ? count : size());
    bytes_ = bytes_.subspan(taken.size());
    return {taken.begin(), taken.end()};
  }

  size_t size() const { return bytes_.size(); }
  bool empty() const { return bytes_.empty(); }
  std::span<const uint8_t> rest() const { return bytes_; }
  std::string_view text() const {
    return {reinterpret_cast<const char*>(bytes_.data()), bytes_.size()};
  }

 private:
  std::span<const uint8_t> bytes_;
};

}  // namespace lightstage::fuzz
