#include "daemon/develop/develop.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>
#include <vector>

#include "base/status.h"
#include "optics/demosaic.h"
#include "optics/hdr.h"

namespace lightstage {
namespace {

static_assert(int{kAboveRange} == int{kSampleAbove} && int{kBelowRange} == int{kSampleBelow});

// Light counts as seen where it fills a good part of a tile: single bright pixels are noise or defects.
constexpr int kTile = 8;
constexpr int kTileShare = 4;  // at least 1/4 of the tile's pixels

absl::Status Bad(const RawShot& raw, const std::string& message, ErrorMetadata metadata) {
  metadata.insert(metadata.begin(), {"shot", absl::StrCat(raw.shot.id)});
  return Error(absl::StatusCode::kInvalidArgument, "SHOT_INVALID",
               absl::StrCat("shot ", raw.shot.id, ": ", message), metadata);
}

std::string Describe(const Frame& frame) {
  return absl::StrCat(frame.width, "×", frame.height, " ", PixelFormatName(frame.format), " with ",
                      frame.significant_bits, " bits at ", frame.gain_db, " dB");
}

absl::Status CheckFrames(const RawShot& raw) {
  if (raw.frames.empty() || raw.frames.size() != raw.shot.exposures.size()) {
    return Bad(raw,
               absl::StrCat("has ", raw.frames.size(), " frames for ", raw.shot.exposures.size(),
                            " exposures; it needs one for each, and at least one"),
               {{"frames", absl::StrCat(raw.frames.size())},
                {"exposures", absl::StrCat(raw.shot.exposures.size())}});
  }
  const Frame& first = raw.frames.front();
  for (size_t j = 0; j < raw.frames.size(); ++j) {
    const Frame& frame = raw.frames[j];
    if (frame.format != first.format || frame.width != first.width ||
        frame.height != first.height || frame.significant_bits != first.significant_bits ||
        frame.gain_db != first.gain_db) {
      return Bad(
          raw,
          absl::StrCat("frame ", j, " is ", Describe(frame), ", but frame 0 is ", Describe(first)),
          {{"frame", absl::StrCat(j)}, {"is", Describe(frame)}, {"first", Describe(first)}});
    }
    const size_t bytes = size_t(std::max(frame.width, 0)) * std::max(frame.height, 0) *
                         SamplesPerPixel(frame.format) * BytesPerSample(frame.format);
    if (bytes == 0 || frame.data.size() != bytes) {
      return Bad(raw,
                 absl::StrCat("frame ", j, ", ", Describe(frame), ", holds ", frame.data.size(),
                              " bytes; it should be ", bytes),
                 {{"frame", absl::StrCat(j)},
                  {"bytes", absl::StrCat(frame.data.size())},
                  {"needed", absl::StrCat(bytes)}});
    }
  }
  const int storage_bits = 8 * BytesPerSample(first.format);
  if (first.significant_bits < 1 || first.significant_bits > storage_bits) {
    return Bad(
        raw,
        absl::StrCat("frames of ", PixelFormatName(first.format), " claim ", first.significant_bits,
                     " bits; it must be 1 to ", storage_bits),
        {{"bits", absl::StrCat(first.significant_bits)}, {"max", absl::StrCat(storage_bits)}});
  }
  if (IsBayer(first.format) && (first.width < 2 || first.height < 2)) {
    return Bad(raw, absl::StrCat("a colour mosaic of ", Describe(first), " is too small: 2×2"),
               {{"width", absl::StrCat(first.width)}, {"height", absl::StrCat(first.height)}});
  }
  return absl::OkStatus();
}

absl::Status CheckLamps(const RawShot& raw, const RigGeometry& geometry) {
  const int count = static_cast<int>(geometry.brace.lamps.size());
  for (const LampLevel& lamp : raw.shot.condition.lamps) {
    if (lamp.lamp < 0 || lamp.lamp >= count) {
      return Bad(raw, absl::StrCat("names lamp ", lamp.lamp, "; the brace has ", count, " lamps"),
                 {{"lamp", absl::StrCat(lamp.lamp)}, {"lamps", absl::StrCat(count)}});
    }
  }
  return absl::OkStatus();
}

CodeRange RangeOf(const Frame& frame, const DevelopOptions& options) {
  CodeRange range;
  range.full_scale = std::exp2(frame.significant_bits) - 1;
  range.black = options.black_level;
  range.low = options.black_level + options.noise_floor * range.full_scale;
  range.high = options.saturation * range.full_scale;
  return range;
}

BayerPhase PhaseOf(PixelFormat format) {
  switch (format) {
    case PixelFormat::kBayerGR8:
    case PixelFormat::kBayerGR16:
      return {1, 0};
    case PixelFormat::kBayerGB8:
    case PixelFormat::kBayerGB16:
      return {0, 1};
    case PixelFormat::kBayerBG8:
    case PixelFormat::kBayerBG16:
      return {1, 1};
    default:
      return {0, 0};
  }
}

absl::StatusOr<BasisImage> MergeFrames(const RawShot& raw, const DevelopOptions& options) {
  const Frame& first = raw.frames.front();
  std::vector<BracketFrame> bracket;
  for (const Frame& frame : raw.frames) {
    bracket.push_back({frame.data, std::chrono::duration<double>(frame.exposure).count()});
  }
  const int channels = SamplesPerPixel(first.format);
  BasisImage out{Image(first.width, first.height, channels), {}};
  std::vector<uint8_t> marks(out.pixels.pixels().size());
  RETURN_IF_ERROR(
      Annotate(MergeBracket(bracket, BytesPerSample(first.format), RangeOf(first, options),
                            options.response, out.pixels.pixels(), marks),
               absl::StrCat("shot ", raw.shot.id)));
  if (IsBayer(first.format)) {
    DemosaicedImage rgb = DemosaicBilinear(out.pixels.pixels(), marks, first.width, first.height,
                                           PhaseOf(first.format));
    return BasisImage{std::move(rgb.pixels), std::move(rgb.marks)};
  }
  if (channels == 1) {
    out.flags = std::move(marks);
    return out;
  }
  out.flags.resize(marks.size() / 3);
  for (size_t i = 0; i < out.flags.size(); ++i) {
    const uint8_t* m = &marks[3 * i];
    out.flags[i] = ((m[0] | m[1] | m[2]) & kAboveRange) | (m[0] & m[1] & m[2] & kBelowRange);
  }
  return out;
}

bool CommandsLight(const Condition& condition) {
  return std::any_of(condition.lamps.begin(), condition.lamps.end(),
                     [](const LampLevel& l) { return l.level > 0; }) ||
         (condition.pattern && condition.pattern->arrangement != PatternArrangement::kBlack);
}

bool SeesLight(const BasisImage& image) {
  const int width = image.pixels.width(), height = image.pixels.height();
  for (int ty = 0; ty < height; ty += kTile) {
    for (int tx = 0; tx < width; tx += kTile) {
      const int right = std::min(tx + kTile, width), bottom = std::min(ty + kTile, height);
      int seen = 0;
      for (int y = ty; y < bottom; ++y) {
        for (int x = tx; x < right; ++x) {
          seen += (image.flags[size_t(y) * width + x] & kBelowRange) == 0;
        }
      }
      if (seen * kTileShare >= (right - tx) * (bottom - ty)) return true;
    }
  }
  return false;
}

template <int kChannels>
ShotChecks CheckPixels(const BasisImage& image) {
  const float* v = image.pixels.pixels().data();
  size_t above = 0, below = 0;
  double sum = 0;
  float maximum = 0;
  for (size_t i = 0; i < image.flags.size(); ++i, v += kChannels) {
    float total = v[0], most = v[0];
    for (int c = 1; c < kChannels; ++c) {
      total += v[c];
      most = std::max(most, v[c]);
    }
    const bool is_above = image.flags[i] & kAboveRange;
    above += is_above;
    below += (image.flags[i] & kBelowRange) != 0;
    sum += is_above ? 0.0f : total;
    maximum = std::max(maximum, most);
  }
  const size_t pixels = image.flags.size();
  ShotChecks checks;
  checks.saturated_share = double(above) / pixels;
  checks.black_share = double(below) / pixels;
  checks.mean = pixels == above ? 0 : sum / (double(pixels - above) * kChannels);
  checks.maximum = maximum;
  return checks;
}

ShotChecks Check(const BasisImage& image, const Condition& condition) {
  ShotChecks checks = image.pixels.channels() == 3 ? CheckPixels<3>(image) : CheckPixels<1>(image);
  checks.nothing_seen = CommandsLight(condition) && !SeesLight(image);
  return checks;
}

}  // namespace

std::optional<Vec3> LightDirection(const Condition& condition, const Pose& pose,
                                   const RigGeometry& geometry) {
  const bool projector =
      condition.pattern && condition.pattern->arrangement != PatternArrangement::kBlack;
  Vec3 sum = Vec3::Zero();
  double levels = 0;
  for (const LampLevel& lamp : condition.lamps) {
    if (lamp.level <= 0) continue;
    sum += lamp.level * LampDirection(geometry.brace.lamps[lamp.lamp], pose.azimuth);
    levels += lamp.level;
  }
  if (projector) {
    if (levels > 0) return std::nullopt;
    return ProjectorDirection(geometry.projector, pose);
  }
  // Lamps all round cancel: what is left of them then is rounding, not a direction.
  if (levels == 0 || sum.norm() < 1e-6 * levels) return std::nullopt;
  return sum.normalized();
}

absl::StatusOr<Developed> Develop(const RawShot& raw, const DevelopOptions& options,
                                  const RigGeometry& geometry) {
  RETURN_IF_ERROR(CheckFrames(raw));
  RETURN_IF_ERROR(CheckLamps(raw, geometry));
  Developed out;
  ASSIGN_OR_RETURN(out.image, MergeFrames(raw, options));
  out.checks = Check(out.image, raw.shot.condition);
  if (raw.shot.kind == ShotKind::kBasis) {
    out.direction = LightDirection(raw.shot.condition, raw.reported_pose, geometry);
  }
  return out;
}

}  // namespace lightstage
