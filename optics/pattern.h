// What a projector shows: a grid of m×m squares on its image, of which some are lit, each with a profile (dissertation §4.5, §6.2).
//
// The grid covers the projector's image exactly: square (x,y) has its centre at ((x+½)/m, (y+½)/m) in image coordinates
// u (right), v (down) ∈ [0,1]². A profile is separable: value(u,v) = Σ over lit squares of w_x(u)·w_y(v), where the 1D profiles
// w_0 … w_{m−1} sum to 1 at every u (normalised at the border too), so that the m² squares together light everything equally.
#pragma once

#include <compare>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "optics/image.h"

namespace lightstage {

enum class PatternProfile {
  kBox,       // the square itself
  kGaussian,  // the box convolved with a Gaussian whose full width at half maximum is the square's side
  kHat,       // linear, reaching zero at the centres of the neighbouring squares
};

// Which squares are lit.
enum class PatternArrangement {
  kBlack,       // none
  kFull,        // all: every projector pixel at 1
  kSquare,      // the one square (column, row)
  kHorizontal,  // in row `row`, the columns column, column+(d+1), …; `column` in [0, d]
  kVertical,    // in column `column`, the rows row, row+(d+1), …; `row` in [0, d]
};

struct Pattern {
  PatternArrangement arrangement = PatternArrangement::kBlack;
  PatternProfile profile = PatternProfile::kBox;
  int grid = 1;       // m, squares per side, [1, 1024]
  int influence = 0;  // d, least number of dark squares between two lit ones, [0, m−1]
  int column = 0;
  int row = 0;
  auto operator<=>(const Pattern&) const = default;
};

struct GridSquare {
  int column, row;
  bool operator==(const GridSquare&) const = default;
};

// INVALID_ARGUMENT / PATTERN_INVALID if a field is out of range for its arrangement.
absl::Status Validate(const Pattern& pattern);

// The lit squares, in order of row, then column. The pattern must be valid.
std::vector<GridSquare> LitSquares(const Pattern& pattern);

// The weight of 1D profile `index` of an m-cell grid at u ∈ [0,1]; a box's cell k covers [k/m, (k+1)/m).
double ProfileWeight(PatternProfile profile, int grid, int index, double u);

// The pattern on a projector of the given native resolution: one channel, linear, [0,1], each pixel the value at its centre.
Image Rasterize(const Pattern& pattern, int width, int height);

// A short name for files and logs, e.g. "full", "square-03-11", "h-r05-o1-d2".
std::string PatternName(const Pattern& pattern);

}  // namespace lightstage
