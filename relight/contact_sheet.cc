#include "relight/contact_sheet.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <map>
#include <utility>

#include "base/status.h"
#include "relight/parallel.h"

namespace lightstage::relight {
namespace {

// Angles closer than this are one: reported poses scatter.
constexpr double kSameDegrees = 0.2;
constexpr int kGap = 2;  // pixels between thumbnails

// Gives each angle the index of its group, groups ascending. With `turn`, 359.9° and 0° are one group.
std::vector<int> Group(const std::vector<double>& degrees, bool turn) {
  std::vector<size_t> order(degrees.size());
  for (size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::sort(order.begin(), order.end(),
            [&](size_t a, size_t b) { return degrees[a] < degrees[b]; });
  std::vector<int> group(degrees.size());
  int current = 0;
  for (size_t k = 1; k < order.size(); ++k) {
    if (degrees[order[k]] - degrees[order[k - 1]] > kSameDegrees) ++current;
    group[order[k]] = current;
  }
  if (turn && current > 0 && degrees[order[0]] + 360 - degrees[order.back()] <= kSameDegrees) {
    for (int& g : group) {
      if (g == current) g = 0;
    }
  }
  return group;
}

struct Spot {
  int azimuth, tilt;  // groups
  size_t image;
};

// One image per direction, ordered by tilt, then azimuth.
std::vector<Spot> Spots(const std::vector<ShotRecord>& basis) {
  std::vector<size_t> images;
  std::vector<double> azimuths, tilts;
  for (size_t i = 0; i < basis.size(); ++i) {
    if (!basis[i].direction) continue;
    const AzimuthTilt angles = AnglesOfDirection(*basis[i].direction);
    images.push_back(i);
    azimuths.push_back(angles.azimuth.degrees());
    tilts.push_back(angles.tilt.degrees());
  }
  if (images.empty()) return {};
  const std::vector<int> azimuth = Group(azimuths, true), tilt = Group(tilts, false);
  std::map<std::pair<int, int>, size_t> best;
  for (size_t k = 0; k < images.size(); ++k) {
    auto [it, is_new] = best.try_emplace({tilt[k], azimuth[k]}, images[k]);
    if (!is_new && basis[images[k]].checks.mean > basis[it->second].checks.mean) {
      it->second = images[k];
    }
  }
  std::vector<Spot> spots;
  for (const auto& [place, image] : best) spots.push_back({place.second, place.first, image});
  return spots;
}

// `count` of `n` things, evenly.
size_t Thinned(size_t k, size_t count, size_t n) { return k * n / count; }

// About 3.2 times as wide as high, at most the given size.
void Size(size_t n, int max_columns, int max_rows, SheetLayout& layout) {
  layout.rows = std::clamp<int>(std::lround(std::sqrt(n / 3.2)), 1, max_rows);
  layout.columns = std::min<int>((n + layout.rows - 1) / layout.rows, max_columns);
  layout.rows = std::min<int>((n + layout.columns - 1) / layout.columns, max_rows);
}

void Draw(const Image& image, int factor, int left, int top, Image& sheet) {
  const int channels = image.channels();
  const int width = image.width() / factor, height = image.height() / factor;
  const float scale = 1.0f / (factor * factor);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int c = 0; c < channels; ++c) {
        float sum = 0;
        for (int dy = 0; dy < factor; ++dy) {
          for (int dx = 0; dx < factor; ++dx) {
            sum += image.at(x * factor + dx, y * factor + dy, c);
          }
        }
        sheet.at(left + x, top + y, c) = sum * scale;
      }
    }
  }
}

}  // namespace

SheetLayout LayOut(const std::vector<ShotRecord>& basis, int max_columns, int max_rows) {
  SheetLayout layout;
  std::vector<Spot> spots = Spots(basis);
  if (spots.empty()) {
    Size(basis.size(), max_columns, max_rows, layout);
    const size_t shown = std::min<size_t>(basis.size(), size_t(layout.columns) * layout.rows);
    for (size_t k = 0; k < shown; ++k) layout.images.push_back(Thinned(k, shown, basis.size()));
    return layout;
  }
  size_t azimuths = 0, tilts = 0;
  for (const Spot& spot : spots) {
    azimuths = std::max(azimuths, size_t(spot.azimuth) + 1);
    tilts = std::max(tilts, size_t(spot.tilt) + 1);
  }
  layout.regular = azimuths * tilts == spots.size();
  if (layout.regular) {
    layout.columns = static_cast<int>(std::min<size_t>(azimuths, max_columns));
    layout.rows = static_cast<int>(std::min<size_t>(tilts, max_rows));
    for (int r = 0; r < layout.rows; ++r) {
      for (int c = 0; c < layout.columns; ++c) {
        const size_t spot =
            Thinned(r, layout.rows, tilts) * azimuths + Thinned(c, layout.columns, azimuths);
        layout.images.push_back(spots[spot].image);
      }
    }
    return layout;
  }
  Size(spots.size(), max_columns, max_rows, layout);
  const size_t shown = std::min<size_t>(spots.size(), size_t(layout.columns) * layout.rows);
  std::vector<Spot> kept;
  for (size_t k = 0; k < shown; ++k) kept.push_back(spots[Thinned(k, shown, spots.size())]);
  for (size_t row = 0; row < shown; row += layout.columns) {
    const auto begin = kept.begin() + row;
    const auto end = kept.begin() + std::min(row + layout.columns, shown);
    std::stable_sort(begin, end,
                     [](const Spot& a, const Spot& b) { return a.azimuth < b.azimuth; });
  }
  for (const Spot& spot : kept) layout.images.push_back(spot.image);
  return layout;
}

absl::StatusOr<Image> MakeContactSheet(const Dataset& dataset, const SheetLayout& layout,
                                       int thumbnail_width) {
  const Manifest& manifest = dataset.manifest();
  int factor = std::max(1, (manifest.width + thumbnail_width - 1) / thumbnail_width);
  factor = std::min({factor, manifest.width, manifest.height});
  const int width = manifest.width / factor + kGap, height = manifest.height / factor + kGap;
  Image sheet(layout.columns * width + kGap, layout.rows * height + kGap, manifest.channels);
  const int threads = ThreadsFor(layout.images.size());
  std::vector<absl::Status> statuses(threads);
  std::atomic<bool> failed = false;
  // Every thumbnail has pixels of its own: the threads share the sheet without a lock.
  RunOnThreads(threads, [&](int t) {
    for (size_t k = t; k < layout.images.size() && !failed; k += threads) {
      absl::StatusOr<BasisImage> image = dataset.Read(dataset.basis()[layout.images[k]]);
      if (!image.ok()) {
        statuses[t] = image.status();
        failed = true;
        return;
      }
      const int column = static_cast<int>(k) % layout.columns;
      const int row = static_cast<int>(k) / layout.columns;
      Draw(image->pixels, factor, kGap + column * width, kGap + row * height, sheet);
    }
  });
  for (const absl::Status& status : statuses) RETURN_IF_ERROR(status);
  return sheet;
}

}  // namespace lightstage::relight
