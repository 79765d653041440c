// What a USB Video Class camera says of itself when it is plugged in (USB 2.0 chapter 9; Video Class 1.1, chapter 3, with its payload
// "Uncompressed").
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "drivers/api/camera.h"

namespace lightstage::sim {

struct UvcDescription {
  std::string product;  // ASCII
  int width = 0, height = 0;
  uint32_t frame_interval = 0;  // 100 ns
};

// Video interfaces, units and terminals, and the streaming endpoint, by their numbers.
constexpr uint8_t kControlInterface = 0, kStreamInterface = 1;
constexpr uint8_t kCameraTerminal = 1, kProcessingUnit = 2, kOutputTerminal = 3;
constexpr uint8_t kStreamEndpoint = 1;

// The picture's formats, by bFormatIndex − 1.
constexpr std::array<PixelFormat, 2> kUvcFormats = {PixelFormat::kMono16, PixelFormat::kMono8};

constexpr size_t UvcFrameBytes(PixelFormat format, int width, int height) {
  return static_cast<size_t>(width) * height * (format == PixelFormat::kMono16 ? 2 : 1);
}

std::vector<uint8_t> UvcDeviceDescriptor();
std::vector<uint8_t> UvcConfigurationDescriptor(const UvcDescription& description);
// 0: the languages; 1: the maker; 2: the product. Empty: there is no such string.
std::vector<uint8_t> UvcStringDescriptor(const UvcDescription& description, int index);

}  // namespace lightstage::sim
