#include "optics/hdr.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <vector>

#include "base/status.h"

namespace lightstage {
namespace {

// Samples are merged in blocks that stay in the first-level cache while the exposures pass over them. All loops run over the whole
// block, beyond the image's end too: their constant length is what lets compilers use vectors at -O2.
constexpr size_t kBlock = 1024;

struct Block {
  std::array<float, kBlock> codes, weighted, weights, bounds, values;
  std::array<uint8_t, kBlock> marks;
};

template <class Code>
void LoadCodes(std::span<const std::byte> samples, Block& block) {
  std::array<Code, kBlock> codes;
  std::memcpy(codes.data(), samples.data(), samples.size());
  std::memset(reinterpret_cast<std::byte*>(codes.data()) + samples.size(), 0,
              sizeof(codes) - samples.size());
  for (size_t i = 0; i < kBlock; ++i) block.codes[i] = codes[i];
}

// The weight of a code; any scale does.
inline float Hat(float code, float low, float high) {
  return std::max(0.0f, std::min(code - low, high - code));
}

void AddLinear(const CodeRange& range, double seconds, Block& block) {
  const float low = range.low, high = range.high, black = range.black;
  const float scale = 1.0 / ((range.full_scale - range.black) * seconds);
  for (size_t i = 0; i < kBlock; ++i) {
    const float code = block.codes[i];
    const float value = (code - black) * scale;
    const float weight = Hat(code, low, high);
    block.weighted[i] += weight * value;
    block.weights[i] += weight;
    block.bounds[i] = std::max(block.bounds[i], code >= high ? value : 0.0f);
  }
}

void AddLogarithmic(const CodeRange& range, const std::vector<float>& table, double seconds,
                    Block& block) {
  const float low = range.low, high = range.high;
  const float log_seconds = std::log(seconds);
  for (size_t i = 0; i < kBlock; ++i) {
    const float code = block.codes[i];
    // A code beyond full scale is a camera's fault; it is saturated, and the table ends.
    const size_t z = std::min(static_cast<size_t>(code), table.size() - 1);
    const float log_value = table[z] - log_seconds;
    const float weight = Hat(code, low, high);
    block.weighted[i] += weight * log_value;
    block.weights[i] += weight;
    if (code >= high) block.bounds[i] = std::max(block.bounds[i], std::exp(log_value));
  }
}

void Finish(bool logarithmic, Block& block) {
  if (logarithmic) {
    for (size_t i = 0; i < kBlock; ++i) {
      // Where nothing was measured the weights and their sum are 0.
      block.weighted[i] = std::exp(block.weighted[i] / std::max(block.weights[i], 1e-30f));
      block.weights[i] = block.weights[i] > 0 ? 1.0f : 0.0f;
    }
  }
  for (size_t i = 0; i < kBlock; ++i) {
    const float measured = block.weighted[i] / block.weights[i];  // NaN if nothing was
    block.values[i] = block.weights[i] > 0 ? measured : block.bounds[i];
  }
  for (size_t i = 0; i < kBlock; ++i) {
    const int unmeasured = block.weights[i] > 0 ? 0 : 1;
    const int bounded = block.bounds[i] > 0 ? 1 : 0;
    block.marks[i] = unmeasured * (bounded * kSampleAbove + (1 - bounded) * kSampleBelow);
  }
}

absl::Status Bad(const std::string& message, const ErrorMetadata& metadata) {
  return Error(absl::StatusCode::kInvalidArgument, "BRACKET_INVALID", message, metadata);
}

absl::Status Check(std::span<const BracketFrame> frames, int bytes_per_sample,
                   const CodeRange& range, const ResponseCurve& response, size_t samples) {
  if (frames.empty()) return Bad("the bracket has no exposure; it needs at least one", {});
  const size_t bytes = samples * bytes_per_sample;
  for (size_t j = 0; j < frames.size(); ++j) {
    if (frames[j].samples.size() != bytes) {
      return Bad(absl::StrCat("exposure ", j, " has ", frames[j].samples.size(),
                              " bytes; the image needs ", bytes),
                 {{"exposure", absl::StrCat(j)},
                  {"bytes", absl::StrCat(frames[j].samples.size())},
                  {"needed", absl::StrCat(bytes)}});
    }
    if (!(frames[j].seconds > 0) || !std::isfinite(frames[j].seconds)) {
      return Bad(absl::StrCat("exposure ", j, " lasted ", frames[j].seconds,
                              " s; it must be a positive time"),
                 {{"exposure", absl::StrCat(j)}, {"seconds", absl::StrCat(frames[j].seconds)}});
    }
  }
  if (!(0 <= range.black && range.black <= range.low && range.low < range.high &&
        range.high <= range.full_scale)) {
    return Bad(absl::StrCat("black level ", range.black, ", noise floor ", range.low,
                            ", saturation ", range.high, " and full scale ", range.full_scale,
                            " must ascend: no code is left to measure with"),
               {{"black", absl::StrCat(range.black)},
                {"low", absl::StrCat(range.low)},
                {"high", absl::StrCat(range.high)},
                {"full_scale", absl::StrCat(range.full_scale)}});
  }
  if (!response.is_linear() && response.levels() != range.full_scale + 1) {
    return Bad(absl::StrCat("the response table has ", response.levels(), " codes; the camera has ",
                            range.full_scale + 1),
               {{"levels", absl::StrCat(response.levels())},
                {"codes", absl::StrCat(range.full_scale + 1)}});
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status MergeBracket(std::span<const BracketFrame> frames, int bytes_per_sample,
                          const CodeRange& range, const ResponseCurve& response,
                          std::span<float> values, std::span<uint8_t> marks) {
  if (marks.size() != values.size() || (bytes_per_sample != 1 && bytes_per_sample != 2)) {
    return Bad(absl::StrCat("a bracket of ", bytes_per_sample, "-byte samples into ", values.size(),
                            " values and ", marks.size(), " marks"),
               {{"bytes_per_sample", absl::StrCat(bytes_per_sample)},
                {"values", absl::StrCat(values.size())},
                {"marks", absl::StrCat(marks.size())}});
  }
  RETURN_IF_ERROR(Check(frames, bytes_per_sample, range, response, values.size()));

  std::vector<float> table(response.levels());
  for (size_t z = 0; z < table.size(); ++z) table[z] = response.LogExposure(z);

  Block block;
  for (size_t start = 0; start < values.size(); start += kBlock) {
    const size_t count = std::min(kBlock, values.size() - start);
    block.weighted.fill(0);
    block.weights.fill(0);
    block.bounds.fill(0);
    for (const BracketFrame& frame : frames) {
      const auto samples =
          frame.samples.subspan(start * bytes_per_sample, count * bytes_per_sample);
      if (bytes_per_sample == 1) {
        LoadCodes<uint8_t>(samples, block);
      } else {
        LoadCodes<uint16_t>(samples, block);
      }
      if (table.empty()) {
        AddLinear(range, frame.seconds, block);
      } else {
        AddLogarithmic(range, table, frame.seconds, block);
      }
    }
    Finish(!table.empty(), block);
    std::copy_n(block.values.begin(), count, values.begin() + start);
    std::copy_n(block.marks.begin(), count, marks.begin() + start);
  }
  return absl::OkStatus();
}

}  // namespace lightstage
