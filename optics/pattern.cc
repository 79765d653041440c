#include "optics/pattern.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "base/status.h"

namespace lightstage {
namespace {

// Cells of one axis that are lit: first, first+step, … below `end`. Every arrangement is a product
// of two such runs.
struct Run {
  int first = 0, step = 1, end = 0;
};
struct Runs {
  Run columns, rows;
};

Runs RunsOf(const Pattern& p) {
  const int m = p.grid;
  switch (p.arrangement) {
    case PatternArrangement::kBlack:
      return {};
    case PatternArrangement::kFull:
      return {{0, 1, m}, {0, 1, m}};
    case PatternArrangement::kSquare:
      return {{p.column, 1, p.column + 1}, {p.row, 1, p.row + 1}};
    case PatternArrangement::kHorizontal:
      return {{p.column, p.influence + 1, m}, {p.row, 1, p.row + 1}};
    case PatternArrangement::kVertical:
      return {{p.column, 1, p.column + 1}, {p.row, p.influence + 1, m}};
  }
  return {};
}

absl::Status CheckRange(const char* field, int value, int lo, int hi) {
  if (value >= lo && value <= hi) return absl::OkStatus();
  return Error(absl::StatusCode::kInvalidArgument, "PATTERN_INVALID",
               absl::StrCat("pattern ", field, " is ", value, "; it must be ", lo, " to ", hi),
               {{"field", field},
                {"value", absl::StrCat(value)},
                {"min", absl::StrCat(lo)},
                {"max", absl::StrCat(hi)}});
}

// Integral of the unit Gaussian of the given FWHM from −∞ to x, minus ½.
double GaussianStep(double x, double fwhm) {
  const double sigma = fwhm / (2 * std::sqrt(2 * std::numbers::ln2));
  return 0.5 * std::erf(x / (sigma * std::numbers::sqrt2));
}

// Sum of the lit profiles at the centre of each of `pixels` pixels.
std::vector<float> SampleRun(PatternProfile profile, int grid, const Run& run, int pixels) {
  std::vector<float> out(pixels);
  for (int i = 0; i < pixels; ++i) {
    double u = (i + 0.5) / pixels, sum = 0;
    for (int k = run.first; k < run.end; k += run.step) sum += ProfileWeight(profile, grid, k, u);
    out[i] = static_cast<float>(std::min(sum, 1.0));
  }
  return out;
}

}  // namespace

absl::Status Validate(const Pattern& p) {
  RETURN_IF_ERROR(CheckRange("grid", p.grid, 1, 1024));
  RETURN_IF_ERROR(CheckRange("influence", p.influence, 0, p.grid - 1));
  const int last = p.grid - 1;
  switch (p.arrangement) {
    case PatternArrangement::kBlack:
    case PatternArrangement::kFull:
      return absl::OkStatus();
    case PatternArrangement::kSquare:
      RETURN_IF_ERROR(CheckRange("column", p.column, 0, last));
      return CheckRange("row", p.row, 0, last);
    case PatternArrangement::kHorizontal:
      RETURN_IF_ERROR(CheckRange("column", p.column, 0, p.influence));
      return CheckRange("row", p.row, 0, last);
    case PatternArrangement::kVertical:
      RETURN_IF_ERROR(CheckRange("column", p.column, 0, last));
      return CheckRange("row", p.row, 0, p.influence);
  }
  return CheckRange("arrangement", static_cast<int>(p.arrangement), 0,
                    static_cast<int>(PatternArrangement::kVertical));
}

std::vector<GridSquare> LitSquares(const Pattern& pattern) {
  const Runs runs = RunsOf(pattern);
  std::vector<GridSquare> out;
  for (int row = runs.rows.first; row < runs.rows.end; row += runs.rows.step) {
    for (int column = runs.columns.first; column < runs.columns.end; column += runs.columns.step) {
      out.push_back({column, row});
    }
  }
  return out;
}

double ProfileWeight(PatternProfile profile, int grid, int index, double u) {
  const double x = u * grid;  // in squares
  switch (profile) {
    case PatternProfile::kBox:
      // The last square also owns u = 1, so that no u is left out.
      return std::min(static_cast<int>(std::floor(x)), grid - 1) == index ? 1 : 0;
    case PatternProfile::kGaussian: {
      // Beyond five squares both steps are equal in double precision.
      if (std::abs(x - index - 0.5) > 5) return 0;
      double box = GaussianStep(x - index, 1) - GaussianStep(x - index - 1, 1);
      return box / (GaussianStep(x, 1) - GaussianStep(x - grid, 1));
    }
    case PatternProfile::kHat: {
      // The sum is 1 between the outermost centres; beyond them the outermost hat stands alone.
      if (x <= 0.5) return index == 0 ? 1 : 0;
      if (x >= grid - 0.5) return index == grid - 1 ? 1 : 0;
      return std::max(0.0, 1 - std::abs(x - index - 0.5));
    }
  }
  return 0;
}

Image Rasterize(const Pattern& pattern, int width, int height) {
  Image image(width, height, 1);
  if (pattern.arrangement == PatternArrangement::kBlack) return image;
  if (pattern.arrangement == PatternArrangement::kFull) return Image(width, height, 1, 1.0f);
  const Runs runs = RunsOf(pattern);
  const std::vector<float> u = SampleRun(pattern.profile, pattern.grid, runs.columns, width);
  const std::vector<float> v = SampleRun(pattern.profile, pattern.grid, runs.rows, height);
  for (int y = 0; y < height; ++y) {
    if (v[y] == 0) continue;
    std::span<float> row = image.row(y);
    for (int x = 0; x < width; ++x) row[x] = u[x] * v[y];
  }
  return image;
}

std::string PatternName(const Pattern& p) {
  const int digits = p.grid > 1000 ? 4 : p.grid > 100 ? 3 : 2;
  const char* suffix = p.profile == PatternProfile::kGaussian ? "-gaussian"
                       : p.profile == PatternProfile::kHat    ? "-hat"
                                                              : "";
  switch (p.arrangement) {
    case PatternArrangement::kBlack:
      return "black";
    case PatternArrangement::kFull:
      return "full";
    case PatternArrangement::kSquare:
      return absl::StrFormat("square-%0*d-%0*d%s", digits, p.column, digits, p.row, suffix);
    case PatternArrangement::kHorizontal:
      return absl::StrFormat("h-r%0*d-o%d-d%d%s", digits, p.row, p.column, p.influence, suffix);
    case PatternArrangement::kVertical:
      return absl::StrFormat("v-c%0*d-o%d-d%d%s", digits, p.column, p.row, p.influence, suffix);
  }
  return "invalid";
}

}  // namespace lightstage
