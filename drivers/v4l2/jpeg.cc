#include "drivers/v4l2/jpeg.h"

#include <turbojpeg.h>

#include <memory>

#include "absl/strings/str_format.h"
#include "base/status.h"

namespace lightstage {

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
  if (tjDecompress2(decoder.get(), in, bytes.size(), reinterpret_cast<unsigned char*>(out.data()),
                    width, 0, height, format == PixelFormat::kRGB8 ? TJPF_RGB : TJPF_GRAY,
                    TJFLAG_ACCURATEDCT | TJFLAG_STOPONWARNING | TJFLAG_LIMITSCANS) != 0) {
    return incomplete(tjGetErrorStr2(decoder.get()));
  }
  return out;
}

}  // namespace lightstage
