#include "relight/environment.h"

#include <algorithm>
#include <atomic>
#include <utility>

#include "base/status.h"
#include "relight/parallel.h"

namespace lightstage::relight {
namespace {

// One thread's part of the sum.
struct Accumulator {
  std::vector<double> sum;
  std::vector<uint8_t> flags;
  absl::Status status;
};

void Add(const BasisImage& basis, const Radiance& weight, int out_channels, Accumulator& to) {
  const std::span<const float> pixels = basis.pixels.pixels();
  const int channels = basis.pixels.channels();
  if (channels == 3) {
    for (size_t i = 0; i < pixels.size(); i += 3) {
      for (int c = 0; c < 3; ++c) to.sum[i + c] += weight[c] * pixels[i + c];
    }
  } else {
    for (size_t i = 0; i < pixels.size(); ++i) {
      for (int c = 0; c < out_channels; ++c) to.sum[i * out_channels + c] += weight[c] * pixels[i];
    }
  }
  for (size_t i = 0; i < basis.flags.size(); ++i) to.flags[i] |= basis.flags[i];
}

double LevelSum(const Condition& condition) {
  double sum = 0;
  for (const LampLevel& lamp : condition.lamps) sum += lamp.level;
  return sum > 0 ? sum : 1;
}

}  // namespace

absl::StatusOr<Relit> RelightWithEnvironment(const Dataset& dataset, const EnvironmentMap& map,
                                             Angle rotate) {
  std::vector<const ShotRecord*> shots;
  std::vector<Vec3> directions;
  for (const ShotRecord& record : dataset.basis()) {
    if (record.shot.condition.pattern) {
      return Error(
          absl::StatusCode::kFailedPrecondition, "LIT_BY_PATTERNS",
          absl::StrCat(record.file, " is lit by projector pattern ",
                       PatternName(*record.shot.condition.pattern),
                       ": an environment map weighs whole lamps, so a light-stage dataset is "
                       "needed"),
          {{"file", record.file}});
    }
    if (!record.direction) continue;
    shots.push_back(&record);
    directions.push_back(*record.direction);
  }
  if (shots.empty()) {
    return Error(absl::StatusCode::kFailedPrecondition, "NO_LIGHT_DIRECTIONS",
                 absl::StrCat("none of the ", dataset.basis().size(),
                              " basis images has a light direction: nothing to weigh them by"),
                 {{"images", absl::StrCat(dataset.basis().size())}});
  }
  Relit relit;
  ASSIGN_OR_RETURN(relit.cells, IntegrateOverCells(map, directions, rotate));

  const Manifest& manifest = dataset.manifest();
  const int channels = manifest.channels == 1 && map.is_grey() ? 1 : 3;
  relit.image = Image(manifest.width, manifest.height, channels);
  const size_t samples = relit.image.pixels().size();
  const int threads = ThreadsFor(shots.size());
  std::vector<Accumulator> parts(threads);
  std::atomic<bool> failed = false;
  RunOnThreads(threads, [&](int t) {
    Accumulator& part = parts[t];
    part.sum.resize(samples);
    part.flags.resize(samples / channels);
    // Fixed shares, so that the sum's order, and with it the picture, is the same every time.
    for (size_t i = t; i < shots.size() && !failed; i += threads) {
      const Radiance weight = relit.cells.weights[i] / LevelSum(shots[i]->shot.condition);
      if ((weight == 0).all()) continue;
      absl::StatusOr<BasisImage> basis = dataset.Read(*shots[i]);
      if (!basis.ok()) {
        part.status = basis.status();
        failed = true;
        return;
      }
      Add(*basis, weight, channels, part);
    }
  });
  size_t above = 0;
  for (const Accumulator& part : parts) RETURN_IF_ERROR(part.status);
  for (size_t i = 0; i < samples; ++i) {
    double sum = 0;
    for (const Accumulator& part : parts) sum += part.sum[i];
    relit.image.pixels()[i] = static_cast<float>(sum);
  }
  for (size_t i = 0; i < samples / channels; ++i) {
    above += std::any_of(parts.begin(), parts.end(),
                         [i](const Accumulator& part) { return part.flags[i] & kAboveRange; });
  }
  relit.above_range_share = static_cast<double>(above) * channels / static_cast<double>(samples);
  relit.images_used = static_cast<int>(shots.size());
  relit.images_skipped = static_cast<int>(dataset.basis().size() - shots.size());
  return relit;
}

}  // namespace lightstage::relight
