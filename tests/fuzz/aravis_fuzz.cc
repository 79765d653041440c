// Pixels out of a camera's buffers.
#include "drivers/aravis/pixel_formats.h"
#include "tests/fuzz/fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace lightstage;
  fuzz::Input in(data, size);
  const GenicamFormat& format = GenicamFormats()[in.Byte() % GenicamFormats().size()];
  const int width = in.Byte() % 40 + 1, height = in.Byte() % 6 + 1;
  const size_t stride = GenicamRowBytes(format, width) + in.Byte() % 4;
  const auto bytes = std::as_bytes(in.rest());
  // In memory of its own size, so that reading past its end is noticed.
  const std::vector<std::byte> image(bytes.begin(), bytes.end());
  const std::vector<std::byte> out = UnpackGenicam(format, image, width, height, stride);
  if (out.empty()) return 0;
  const size_t samples = static_cast<size_t>(width) * height * SamplesPerPixel(format.format);
  HOLDS(out.size() == samples * BytesPerSample(format.format));
  HOLDS(image.size() >= GenicamRowBytes(format, width));
  if (format.packing == GenicamPacking::kNone) return 0;
  for (size_t i = 0; i < out.size(); i += 2) {
    const unsigned sample = static_cast<unsigned>(out[i]) | static_cast<unsigned>(out[i + 1]) << 8;
    HOLDS(sample >> format.significant_bits == 0);
  }
  return 0;
}
