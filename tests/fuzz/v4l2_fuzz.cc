// Pixels out of buffers and JPEG pictures, names of formats, frame numbers.
#include <algorithm>
#include <string>

#include "base/status.h"
#include "drivers/v4l2/free_running.h"
#include "drivers/v4l2/jpeg.h"
#include "drivers/v4l2/pixel_formats.h"
#include "tests/fuzz/fuzz.h"

namespace lightstage {
namespace {

using fuzz::Input;

void Pixels(Input in) {
  VideoFormat format = VideoFormats()[in.Byte() % VideoFormats().size()];
  if (format.packing == Packing::kJpeg) return;
  const YuvRange range = in.Choice(2) == 0 ? YuvRange::kLimited : YuvRange::kFull;
  RawImage image;
  // Mostly images that could be, of a few pixels; else any numbers.
  if (in.Choice(4) != 0) {
    image.width = in.Byte() % 40 + 1;
    image.height = in.Byte() % 6 + 1;
    image.bytes_per_line = RowBytes(format.packing, image.width) + in.Byte() % 4;
  } else {
    image.width = static_cast<int>(in.Long());
    image.height = static_cast<int>(in.Long());
    image.bytes_per_line = static_cast<size_t>(in.Long()) << in.Byte() % 33;
  }
  image.bytes = std::as_bytes(in.rest());
  const auto out = Unpack(format, image, range);
  if (!out.ok()) {
    const std::string reason = ErrorReason(out.status());
    HOLDS(reason == "FRAME_LAYOUT" || reason == "FRAME_INCOMPLETE" || reason == "SAMPLE_RANGE");
    return;
  }
  const size_t samples =
      static_cast<size_t>(image.width) * image.height * SamplesPerPixel(format.format);
  HOLDS(out->size() == samples * BytesPerSample(format.format));
  HOLDS(image.bytes.size() >= RowBytes(format.packing, image.width));
  if (BytesPerSample(format.format) == 2) {
    for (size_t i = 0; i < out->size(); i += 2) {
      const unsigned sample =
          static_cast<unsigned>((*out)[i]) | static_cast<unsigned>((*out)[i + 1]) << 8;
      HOLDS(sample >> format.significant_bits == 0);
    }
  }
  // Neither padding nor what follows the image is a part of it.
  std::vector<std::byte> other(image.bytes.begin(), image.bytes.end());
  const size_t row = RowBytes(format.packing, image.width);
  for (size_t i = 0; i < other.size(); ++i) {
    const bool pixel = i / image.bytes_per_line < static_cast<size_t>(image.height) &&
                       i % image.bytes_per_line < row;
    if (!pixel) other[i] = ~other[i];
  }
  image.bytes = other;
  const auto again = Unpack(format, image, range);
  HOLDS(again.ok() && *again == *out);
}

void Jpeg(Input in) {
  const int width = in.Byte() % 40 + 1, height = in.Byte() % 40 + 1;
  const PixelFormat format = in.Choice(2) == 0 ? PixelFormat::kMono8 : PixelFormat::kRGB8;
  const auto out = DecodeJpeg(std::as_bytes(in.rest()), width, height, format);
  if (!out.ok()) {
    HOLDS(ErrorReason(out.status()) == (CanDecodeJpeg() ? "FRAME_INCOMPLETE" : "NOT_BUILT"));
    return;
  }
  HOLDS(out->size() == static_cast<size_t>(width) * height * SamplesPerPixel(format));
  // What follows the picture is no part of it.
  std::vector<uint8_t> longer(in.rest().begin(), in.rest().end());
  longer.insert(longer.end(), 8, 0xff);
  const auto again = DecodeJpeg(std::as_bytes(std::span(longer)), width, height, format);
  HOLDS(again.ok() && *again == *out);
}

void Names(Input in) {
  const uint32_t fourcc = in.Long();
  const std::string name = FourCcName(fourcc);
  HOLDS(name.size() == 4 || name.size() == 7);
  for (char c : name) HOLDS(c >= ' ' && c <= '~');
  const uint32_t back = FourCc(name);
  HOLDS(FourCcName(back) == name);
  if (name.find('?') == std::string::npos) HOLDS(back == fourcc);
  // Any text: none, or a format whose name it is.
  const std::string_view text = in.text();
  if (const uint32_t named = FourCc(text); named != 0) {
    HOLDS(FourCcName(named).starts_with(text.substr(0, 4)));
    HOLDS(FourCc(FourCcName(named)) == named);
  }
  IsCompressed(fourcc);
}

void Counts(Input in) {
  FrameCounter counter;
  uint64_t last = 0;
  while (!in.empty()) {
    const bool restart = in.Choice(8) == 0;
    if (restart) counter.Restart();
    const FrameCounter::Step step = counter.Next(in.Choice(4) != 0 ? in.Byte() : in.Long());
    HOLDS(step.sequence == last + 1 + step.skipped);
    HOLDS(!step.backwards || step.skipped == 0);
    HOLDS(!restart || (step.skipped == 0 && !step.backwards));
    last = step.sequence;
  }
}

}  // namespace
}  // namespace lightstage

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  lightstage::fuzz::Input in(data, size);
  switch (in.Choice(4)) {
    case 0:
      lightstage::Pixels(in);
      break;
    case 1:
      lightstage::Names(in);
      break;
    case 2:
      lightstage::Counts(in);
      break;
    default:
      lightstage::Jpeg(in);
  }
  return 0;
}
