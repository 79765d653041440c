#include "dataset/exr_codec.h"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfIO.h>
#include <ImfOutputFile.h>
#include <ImfTestFile.h>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include <cmath>
#include <cstring>
#include <exception>
#include <new>
#include <stdexcept>

#include "base/status.h"

namespace lightstage::exr_codec {
namespace {

class MemoryOutput final : public Imf::OStream {
 public:
  explicit MemoryOutput(size_t reserve) : Imf::OStream("memory") { bytes_.reserve(reserve); }

  void write(const char* c, int n) override {
    size_t end = position_ + static_cast<size_t>(n);
    if (position_ == bytes_.size()) {
      bytes_.append(c, static_cast<size_t>(n));
    } else {
      if (end > bytes_.size()) bytes_.resize(end);
      std::memcpy(bytes_.data() + position_, c, static_cast<size_t>(n));
    }
    position_ = end;
  }
  uint64_t tellp() override { return position_; }
  void seekp(uint64_t position) override { position_ = position; }

  std::string Take() { return std::move(bytes_); }

 private:
  std::string bytes_;
  size_t position_ = 0;
};

class MemoryInput final : public Imf::IStream {
 public:
  explicit MemoryInput(std::string_view bytes) : Imf::IStream("memory"), bytes_(bytes) {}

  bool read(char* c, int n) override {
    if (n < 0 || position_ > bytes_.size() || bytes_.size() - position_ < static_cast<size_t>(n)) {
      throw std::runtime_error("unexpected end of file");
    }
    std::memcpy(c, bytes_.data() + position_, static_cast<size_t>(n));
    position_ += static_cast<size_t>(n);
    return position_ < bytes_.size();
  }
  uint64_t tellg() override { return position_; }
  void seekg(uint64_t position) override { position_ = position; }

 private:
  const std::string_view bytes_;
  uint64_t position_ = 0;
};

HalfResult ToHalfScalar(const float* from, size_t count, uint16_t* to) {
  HalfResult result = HalfResult::kExact;
  for (size_t i = 0; i < count; ++i) {
    float value = from[i];
    if (!(std::fabs(value) <= kLargestHalf)) {
      if (!std::isfinite(value)) return HalfResult::kNotFinite;
      value = std::copysign(kLargestHalf, value);
      result = HalfResult::kClamped;
    }
    to[i] = imath_float_to_half(value);
  }
  return result;
}

#if defined(__x86_64__)
// Six times as fast as the scalar way, which took a third of an uncompressed file's encoding.
__attribute__((target("avx,f16c"))) HalfResult ToHalfF16c(const float* from, size_t count,
                                                          uint16_t* to) {
  const __m256 sign = _mm256_set1_ps(-0.0f);
  const __m256 largest = _mm256_set1_ps(kLargestHalf);
  HalfResult result = HalfResult::kExact;
  size_t i = 0;
  for (; i + 8 <= count; i += 8) {
    __m256 values = _mm256_loadu_ps(from + i);
    // True for NaN too.
    __m256 outside = _mm256_cmp_ps(_mm256_andnot_ps(sign, values), largest, _CMP_NLE_UQ);
    if (_mm256_movemask_ps(outside) != 0) {
      HalfResult these = ToHalfScalar(from + i, 8, to + i);
      if (these == HalfResult::kNotFinite) return these;
      result = HalfResult::kClamped;
      continue;
    }
    _mm_storeu_si128(reinterpret_cast<__m128i*>(to + i),
                     _mm256_cvtps_ph(values, _MM_FROUND_TO_NEAREST_INT));
  }
  HalfResult tail = ToHalfScalar(from + i, count - i, to + i);
  return tail == HalfResult::kExact ? result : tail;
}
#endif

absl::Status CheckSize(const Imath::Box2i& window, std::string_view name) {
  int64_t width = int64_t{window.max.x} - window.min.x + 1;
  int64_t height = int64_t{window.max.y} - window.min.y + 1;
  if (width < 1 || height < 1 || width > kMaxExrSide || height > kMaxExrSide ||
      static_cast<uint64_t>(width) * static_cast<uint64_t>(height) > kMaxExrSamples) {
    return Corrupt(name, absl::StrCat("its header says ", width, "x", height, " pixels; at most ",
                                      kMaxExrSide, " a side are read"));
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status Corrupt(std::string_view name, std::string_view why) {
  return Error(absl::StatusCode::kDataLoss, "EXR_CORRUPT", absl::StrCat(name, ": ", why),
               {{"file", std::string(name)}, {"why", std::string(why)}});
}

absl::Status Unsupported(std::string_view name, std::string_view why) {
  return Error(absl::StatusCode::kInvalidArgument, "EXR_UNSUPPORTED", absl::StrCat(name, ": ", why),
               {{"file", std::string(name)}, {"why", std::string(why)}});
}

Imf::Compression ToImf(ExrCompression compression) {
  switch (compression) {
    case ExrCompression::kNone:
      return Imf::NO_COMPRESSION;
    case ExrCompression::kRle:
      return Imf::RLE_COMPRESSION;
    case ExrCompression::kZips:
      return Imf::ZIPS_COMPRESSION;
    case ExrCompression::kZip:
      return Imf::ZIP_COMPRESSION;
    case ExrCompression::kPiz:
      return Imf::PIZ_COMPRESSION;
    case ExrCompression::kDwaa:
      return Imf::DWAA_COMPRESSION;
  }
  return Imf::NO_COMPRESSION;
}

std::vector<std::string> ChannelNames(int channels) {
  if (channels == 1) return {"Y"};
  return {"R", "G", "B"};
}

Imf::Header MakeHeader(int width, int height, const std::vector<std::string>& channels,
                       Imf::PixelType type, ExrCompression compression) {
  Imf::Header header(width, height);
  header.compression() = ToImf(compression);
  for (const std::string& channel : channels) header.channels().insert(channel, Imf::Channel(type));
  return header;
}

HalfResult ToHalf(const float* from, size_t count, uint16_t* to) {
#if defined(__x86_64__)
  // Every processor with AVX2 has F16C, which clang 14 can not ask for.
  static const bool has_f16c = __builtin_cpu_supports("avx2");
  if (has_f16c) return ToHalfF16c(from, count, to);
#endif
  return ToHalfScalar(from, count, to);
}

absl::StatusOr<std::string> Write(const Imf::Header& header, const std::vector<Plane>& planes) {
  try {
    const Imath::Box2i& window = header.dataWindow();
    int height = window.max.y - window.min.y + 1;
    int width = window.max.x - window.min.x + 1;
    Imf::FrameBuffer buffer;
    size_t reserve = 4096;
    for (const Plane& plane : planes) {
      size_t sample = plane.type == Imf::HALF ? 2 : 4;
      reserve += sample * static_cast<size_t>(width) * static_cast<size_t>(height);
      // OpenEXR only reads what it writes from, but its frame buffers know no const.
      char* base = const_cast<char*>(static_cast<const char*>(plane.data));
      buffer.insert(plane.name, Imf::Slice(plane.type, base, plane.x_stride, plane.y_stride));
    }
    MemoryOutput out(reserve + 8 * static_cast<size_t>(height));
    {
      Imf::OutputFile file(out, header, /*numThreads=*/0);  // each worker encodes a file of its own
      file.setFrameBuffer(buffer);
      file.writePixels(height);
    }
    return out.Take();
  } catch (const std::exception& e) {
    return Error(absl::StatusCode::kInternal, "EXR_WRITE",
                 absl::StrCat("OpenEXR could not encode: ", e.what()), {{"why", e.what()}});
  }
}

absl::Status Read(std::string_view bytes, std::string_view name,
                  absl::FunctionRef<absl::Status(Imf::InputFile&)> read) {
  try {
    // Process-wide in OpenEXR: no header may make it allocate tables for more than this.
    static const bool limited = [] {
      Imf::Header::setMaxImageSize(kMaxExrSide, kMaxExrSide);
      return true;
    }();
    (void)limited;
    MemoryInput in(bytes);
    Imf::InputFile file(in, /*numThreads=*/0);
    RETURN_IF_ERROR(CheckSize(file.header().dataWindow(), name));
    if (!file.isComplete()) return Corrupt(name, "the file is incomplete");
    return read(file);
  } catch (const std::bad_alloc&) {
    return Error(absl::StatusCode::kResourceExhausted, "MEMORY",
                 absl::StrCat(name, ": there is not enough memory to read it"),
                 {{"file", std::string(name)}});
  } catch (const std::exception& e) {
    return Corrupt(name, e.what());
  }
}

absl::StatusOr<Image> ReadPixels(Imf::InputFile& file, std::string_view name) {
  const Imf::Header& header = file.header();
  const Imath::Box2i& window = header.dataWindow();
  if (window != header.displayWindow()) {
    return Unsupported(name, "the data window is not the display window (a cropped picture)");
  }
  std::vector<std::string> channels;
  for (int count : {3, 1}) {
    std::vector<std::string> names = ChannelNames(count);
    bool all = true;
    for (const std::string& channel : names) {
      const Imf::Channel* found = header.channels().findChannel(channel);
      all = all && found != nullptr && found->xSampling == 1 && found->ySampling == 1;
    }
    if (all) {
      channels = std::move(names);
      break;
    }
  }
  if (channels.empty()) {
    std::string present;
    for (auto it = header.channels().begin(); it != header.channels().end(); ++it) {
      absl::StrAppend(&present, present.empty() ? "" : ", ", it.name());
    }
    return Unsupported(name, absl::StrCat("wants channels R, G, B or Y, has ", present));
  }
  int width = window.max.x - window.min.x + 1;
  int height = window.max.y - window.min.y + 1;
  int count = static_cast<int>(channels.size());
  if (static_cast<uint64_t>(width) * height * count > kMaxExrSamples) {
    return Corrupt(name, absl::StrCat("its header says ", width, "x", height, " pixels"));
  }
  Image image(width, height, count);
  size_t pixel = sizeof(float) * static_cast<size_t>(count);
  Imf::FrameBuffer buffer;
  for (int c = 0; c < count; ++c) {
    buffer.insert(channels[c], Imf::Slice::Make(Imf::FLOAT, image.pixels().data() + c, window,
                                                pixel, pixel * static_cast<size_t>(width)));
  }
  file.setFrameBuffer(buffer);
  file.readPixels(window.min.y, window.max.y);
  return image;
}

}  // namespace lightstage::exr_codec
