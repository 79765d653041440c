// Packs pictures for the tests' camera as the tables of the kernel's section "Image Formats" say. It shares no code with the driver.
#pragma once

#include <cstdint>
#include <vector>

#include "absl/functional/function_ref.h"

namespace lightstage {

int FakeBits(uint32_t fourcc);                  // of a sample
int FakeLineBytes(uint32_t fourcc, int width);  // that hold pixels, in whole groups

// One line. `sample(x, c)` has FakeBits(fourcc); c is the channel: 0 but for RGB.
std::vector<uint8_t> PackLine(uint32_t fourcc, int width,
                              absl::FunctionRef<unsigned(int x, int c)> sample);

// A picture that is different everywhere.
unsigned FakeSample(int x, int y, int c, int bits);

}  // namespace lightstage
