#include "drivers/v4l2/jpeg.h"

#include <turbojpeg.h>

#include <memory>
#include <string>

#include "absl/strings/str_format.h"
#include "base/status.h"

namespace lightstage {

namespace {

constexpr int kStartOfScan = 0xda, kEndOfImage = 0xd9, kRestart0 = 0xd0, kRestart7 = 0xd7;

int At(std::span<const std::byte> bytes, size_t i) { return static_cast<int>(bytes[i]); }

// Where the end marker of a picture of one scan stands: its size if it has none (ITU-T T.81, B.1.1).
size_t EndMarkerOf(std::span<const std::byte> bytes) {
  const size_t size = bytes.size();
  size_t at = 2;
  for (int marker = 0; marker != kStartOfScan;) {
    if (at + 4 > size || At(bytes, at) != 0xff) return size;
    marker = At(bytes, at + 1);
    at += 2 + static_cast<size_t>(At(bytes, at + 2) << 8 | At(bytes, at + 3));
  }
  for (; at + 1 < size; ++at) {
    const int next = At(bytes, at + 1);
    // Stuffed, filled up, or a restart of the coding.
    const bool data = next == 0 || next == 0xff || (next >= kRestart0 && next <= kRestart7);
    if (At(bytes, at) == 0xff && !data) return next == kEndOfImage ? at : size;
  }
  return size;
}

// As a whole and undamaged picture: empty, or why it is none.
std::string DecodeStrictly(tjhandle decoder, std::span<const std::byte> bytes, int width,
                           int height, PixelFormat format, std::span<std::byte> out) {
  const auto* const in = reinterpret_cast<const unsigned char*>(bytes.data());
  return tjDecompress2(decoder, in, bytes.size(), reinterpret_cast<unsigned char*>(out.data()),
                       width, 0, height, format == PixelFormat::kRGB8 ? TJPF_RGB : TJPF_GRAY,
                       TJFLAG_ACCURATEDCT | TJFLAG_STOPONWARNING | TJFLAG_LIMITSCANS) == 0
             ? ""
             : tjGetErrorStr2(decoder);
}

}  // namespace

bool CanDecodeJpeg() { return true; }

absl::StatusOr<std::vector<std::byte>> DecodeJpeg(std::span<const std::byte> bytes, int width,
                                                  int height, PixelFormat format) {
  const auto incomplete = [&](std::string_view why) {
    const std::string what = absl::StrFormat("%d bytes of %dx%d MJPG", bytes.size(), width, height);
    return Error(absl::StatusCode::kDataLoss, "FRAME_INCOMPLETE", absl::StrCat(what, ": ", why),
                 {{"image", what}, {"why", std::string(why)}});
  };
  const std::unique_ptr<void, int (*)(tjhandle)> decoder(tjInitDecompress(), tjDestroy);
  if (decoder == nullptr) {
    return Error(absl::StatusCode::kResourceExhausted, "MEMORY",
                 absl::StrCat("libjpeg-turbo: ", tjGetErrorStr2(nullptr)));
  }
  const auto* const in = reinterpret_cast<const unsigned char*>(bytes.data());
  int got_width = 0, got_height = 0, subsampling = 0, colorspace = 0;
  if (tjDecompressHeader3(decoder.get(), in, bytes.size(), &got_width, &got_height, &subsampling,
                          &colorspace) != 0) {
    return incomplete(tjGetErrorStr2(decoder.get()));
  }
  // Before there is memory for it: the size that a damaged header tells can be any.
  if (got_width != width || got_height != height) {
    return incomplete(absl::StrFormat("it is a picture of %dx%d", got_width, got_height));
  }
  std::vector<std::byte> out(static_cast<size_t>(width) * height * SamplesPerPixel(format));
  const std::string why = DecodeStrictly(decoder.get(), bytes, width, height, format, out);
  if (why.empty()) return out;
  // Some cameras fill up with zeros before the end marker: without them it must be whole. The last byte of a picture's own is filled up with ones
  // (T.81, F.1.2.3), so that a zero is its own if it is the one that follows every FF, and else only where all eight bits are of its code: that
  // can not be told from a byte that was lost, and is refused.
  const size_t marker = EndMarkerOf(bytes);
  size_t data = marker;
  while (data > 0 && marker < bytes.size() && bytes[data - 1] == std::byte{}) --data;
  if (data > 0 && data < marker && bytes[data - 1] == std::byte{0xff}) ++data;
  if (data < marker) {
    std::vector<std::byte> trimmed(bytes.begin(), bytes.begin() + static_cast<ptrdiff_t>(data));
    trimmed.insert(trimmed.end(), bytes.begin() + static_cast<ptrdiff_t>(marker), bytes.end());
    if (DecodeStrictly(decoder.get(), trimmed, width, height, format, out).empty()) return out;
  }
  return incomplete(why);
}

}  // namespace lightstage
