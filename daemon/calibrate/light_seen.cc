#include "daemon/calibrate/light_seen.h"

#include <algorithm>
#include <limits>
#include <numeric>

#include "absl/strings/str_format.h"
#include "base/status.h"

namespace lightstage {
namespace {

// Light counts as seen from so much on above the dark: a share of the whole light, so many times what the dark itself varies, and more than
// rounding to codes can hide.
constexpr double kShare = 0.02, kVariations = 3, kCodes = 1.5;
// A row whose threshold is a greater share of the light tells too little.
constexpr double kGreatestShare = 0.1;
// The light is on if there is so much of it.
constexpr double kWhole = 0.8;

// One row in all of the frames.
std::pair<double, double> Range(const std::vector<RowMeans>& frames, size_t row) {
  double least = frames.front()[row], most = least;
  for (const RowMeans& rows : frames) {
    least = std::min(least, rows[row]);
    most = std::max(most, rows[row]);
  }
  return {least, most};
}

}  // namespace

RowMeans RowMeansOf(const Frame& frame) {
  const size_t bytes = BytesPerSample(frame.format);
  const size_t samples = static_cast<size_t>(frame.width) * SamplesPerPixel(frame.format);
  RowMeans rows(frame.height);
  const std::byte* in = frame.data.data();
  for (double& row : rows) {
    uint64_t sum = 0;
    for (size_t i = 0; i < samples; ++i, in += bytes) {
      sum += static_cast<unsigned>(in[0]);
      if (bytes == 2) sum += static_cast<unsigned>(in[1]) << 8;
    }
    row = static_cast<double>(sum) / static_cast<double>(samples);
  }
  return rows;
}

absl::StatusOr<LightSeen> LightSeen::Learn(const std::vector<RowMeans>& dark,
                                           const std::vector<RowMeans>& lit) {
  LightSeen seen;
  const size_t last = dark.front().size() - 1;
  for (size_t row = 0; row <= last; ++row) {
    const auto [darkest, dark_most] = Range(dark, row);
    const auto [lit_least, lit_most] = Range(lit, row);
    // Light that flickers counts for what it is at its darkest.
    const double light = lit_least - dark_most;
    const double step = std::max({kShare * light, kVariations * (dark_most - darkest), kCodes});
    const bool clear = step <= kGreatestShare * light;
    seen.threshold_.push_back(clear ? dark_most + step : std::numeric_limits<double>::infinity());
    if (row != 0 && row != last) continue;
    if (!clear) {
      return Error(
          absl::StatusCode::kFailedPrecondition, "LIGHT_NOT_SEEN",
          absl::StrFormat(
              "row %d of the picture has codes of %.1f to %.1f in the dark and of %.1f to "
              "%.1f in the light, which must differ by %.1f at least; put something white, "
              "evenly lit and at rest before the camera, so that it fills the picture, and "
              "darken the room",
              row, darkest, dark_most, lit_least, lit_most, step / kGreatestShare),
          {{"row", absl::StrCat(row)},
           {"dark", absl::StrCat(dark_most)},
           {"lit", absl::StrCat(lit_least)}});
    }
    if (row == 0) seen.first_whole_ = dark_most + kWhole * light;
    if (row == last) seen.last_whole_ = dark_most + kWhole * light;
    seen.unseen_ = std::max(seen.unseen_, (dark_most + step - darkest) / (kWhole * light));
  }
  return seen;
}

bool LightSeen::Any(const RowMeans& rows) const {
  return std::mismatch(rows.begin(), rows.end(), threshold_.begin(), std::less_equal<>()).first !=
         rows.end();
}

bool LightSeen::Whole(const RowMeans& rows) const {
  return rows.front() >= first_whole_ && rows.back() >= last_whole_;
}

}  // namespace lightstage
