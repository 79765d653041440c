#include "optics/pattern.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "base/status.h"
#include "gtest/gtest.h"

namespace lightstage {
namespace {

constexpr PatternProfile kProfiles[] = {PatternProfile::kBox, PatternProfile::kGaussian,
                                        PatternProfile::kHat};

TEST(ProfileWeight, SumsToOneEverywhere) {
  for (PatternProfile profile : kProfiles) {
    for (int m : {1, 2, 3, 16, 64}) {
      for (int i = 0; i <= 997; ++i) {
        double u = i / 997.0, sum = 0;
        for (int k = 0; k < m; ++k) {
          double w = ProfileWeight(profile, m, k, u);
          EXPECT_GE(w, 0);
          sum += w;
        }
        EXPECT_NEAR(sum, 1, 1e-12) << "profile " << int(profile) << " m " << m << " u " << u;
      }
    }
  }
}

// Far from the border the Gaussian profile is the plain convolution: compared with a numerical one.
TEST(ProfileWeight, GaussianIsTheBoxConvolved) {
  const int m = 16, k = 8;
  const double side = 1.0 / m;
  const double sigma = side / 2.354820045030949;  // FWHM = side
  for (double u : {0.40, 0.5, 0.53125, 0.55, 0.6}) {
    double sum = 0;
    const int n = 20000;
    for (int i = 0; i < n; ++i) {
      double t = (k + (i + 0.5) / n) * side;
      sum += std::exp(-(u - t) * (u - t) / (2 * sigma * sigma)) /
             (sigma * std::sqrt(2 * std::numbers::pi)) * side / n;
    }
    EXPECT_NEAR(ProfileWeight(PatternProfile::kGaussian, m, k, u), sum, 1e-7) << u;
  }
}

TEST(ProfileWeight, HatIsLinearAndReachesTheNeighboursCentres) {
  EXPECT_DOUBLE_EQ(ProfileWeight(PatternProfile::kHat, 4, 1, 0.375), 1);
  EXPECT_DOUBLE_EQ(ProfileWeight(PatternProfile::kHat, 4, 1, 0.625), 0);
  EXPECT_DOUBLE_EQ(ProfileWeight(PatternProfile::kHat, 4, 1, 0.5), 0.5);
  EXPECT_DOUBLE_EQ(ProfileWeight(PatternProfile::kHat, 4, 0, 0.0), 1);
}

TEST(ProfileWeight, BoxesAreHalfOpen) {
  EXPECT_EQ(ProfileWeight(PatternProfile::kBox, 4, 1, 0.25), 1);
  EXPECT_EQ(ProfileWeight(PatternProfile::kBox, 4, 0, 0.25), 0);
  EXPECT_EQ(ProfileWeight(PatternProfile::kBox, 4, 3, 1.0), 1);
}

std::vector<Pattern> Sets(int m, int d, PatternArrangement arrangement) {
  std::vector<Pattern> out;
  for (int line = 0; line < m; ++line) {
    for (int offset = 0; offset <= d; ++offset) {
      Pattern p{.arrangement = arrangement, .grid = m, .influence = d};
      bool horizontal = arrangement == PatternArrangement::kHorizontal;
      p.row = horizontal ? line : offset;
      p.column = horizontal ? offset : line;
      out.push_back(p);
    }
  }
  return out;
}

// Each square lies in exactly one horizontal and one vertical pattern, and is all that these two
// share.
TEST(LitSquares, HorizontalAndVerticalMeetInExactlyTheSquare) {
  for (auto [m, d] : {std::pair{16, 2}, {7, 3}, {5, 0}, {4, 3}}) {
    auto horizontal = Sets(m, d, PatternArrangement::kHorizontal);
    auto vertical = Sets(m, d, PatternArrangement::kVertical);
    EXPECT_EQ(horizontal.size() + vertical.size(), size_t(2 * m * (d + 1)));
    auto containing = [](const std::vector<Pattern>& sets, GridSquare s) {
      std::vector<std::vector<GridSquare>> found;
      for (const Pattern& p : sets) {
        EXPECT_TRUE(Validate(p).ok());
        auto lit = LitSquares(p);
        if (std::find(lit.begin(), lit.end(), s) != lit.end()) found.push_back(lit);
      }
      return found;
    };
    for (int y = 0; y < m; ++y) {
      for (int x = 0; x < m; ++x) {
        auto h = containing(horizontal, {x, y});
        auto v = containing(vertical, {x, y});
        ASSERT_EQ(h.size(), 1u);
        ASSERT_EQ(v.size(), 1u);
        std::vector<GridSquare> shared;
        for (GridSquare s : h[0]) {
          if (std::find(v[0].begin(), v[0].end(), s) != v[0].end()) shared.push_back(s);
        }
        ASSERT_EQ(shared.size(), 1u);
        EXPECT_EQ(shared[0], (GridSquare{x, y}));
      }
    }
  }
}

TEST(LitSquares, KeepsTheInfluenceDistance) {
  Pattern p{.arrangement = PatternArrangement::kHorizontal,
            .grid = 8,
            .influence = 2,
            .column = 1,
            .row = 5};
  EXPECT_EQ(LitSquares(p), (std::vector<GridSquare>{{1, 5}, {4, 5}, {7, 5}}));
  p.arrangement = PatternArrangement::kVertical;
  p.row = 2;
  EXPECT_EQ(LitSquares(p), (std::vector<GridSquare>{{1, 2}, {1, 5}}));
  p.arrangement = PatternArrangement::kBlack;
  EXPECT_TRUE(LitSquares(p).empty());
  p.arrangement = PatternArrangement::kFull;
  EXPECT_EQ(LitSquares(p).size(), 64u);
}

TEST(Rasterize, SetsOfEveryProfileAddUpToFullLight) {
  const int width = 37, height = 23;  // no multiple of the grid
  for (PatternProfile profile : kProfiles) {
    for (auto arrangement : {PatternArrangement::kHorizontal, PatternArrangement::kVertical}) {
      std::vector<double> sum(width * height);
      for (Pattern p : Sets(8, 2, arrangement)) {
        p.profile = profile;
        Image image = Rasterize(p, width, height);
        for (size_t i = 0; i < sum.size(); ++i) sum[i] += image.pixels()[i];
      }
      for (double s : sum) EXPECT_NEAR(s, 1, 1e-5);
    }
  }
}

TEST(Rasterize, IsTheSumOfTheLitSquaresProfiles) {
  Pattern p{.arrangement = PatternArrangement::kVertical,
            .profile = PatternProfile::kGaussian,
            .grid = 8,
            .influence = 1,
            .column = 3,
            .row = 1};
  Image image = Rasterize(p, 32, 20);
  for (int y = 0; y < 20; ++y) {
    for (int x = 0; x < 32; ++x) {
      double sum = 0;
      for (GridSquare s : LitSquares(p)) {
        sum += ProfileWeight(p.profile, 8, s.column, (x + 0.5) / 32) *
               ProfileWeight(p.profile, 8, s.row, (y + 0.5) / 20);
      }
      EXPECT_NEAR(image.at(x, y, 0), sum, 1e-6);
    }
  }
}

TEST(Rasterize, BoxIsSharp) {
  Pattern p{.arrangement = PatternArrangement::kSquare, .grid = 4, .column = 2, .row = 1};
  Image image = Rasterize(p, 16, 8);
  for (int y = 0; y < 8; ++y) {
    for (int x = 0; x < 16; ++x) {
      EXPECT_EQ(image.at(x, y, 0), (x / 4 == 2 && y / 2 == 1) ? 1 : 0);
    }
  }
  Image full = Rasterize({.arrangement = PatternArrangement::kFull, .grid = 3}, 5, 5);
  EXPECT_TRUE(
      std::all_of(full.pixels().begin(), full.pixels().end(), [](float v) { return v == 1; }));
}

TEST(Validate, NamesTheFieldThatIsOutOfRange) {
  Pattern good{.arrangement = PatternArrangement::kHorizontal,
               .grid = 16,
               .influence = 2,
               .column = 2,
               .row = 15};
  EXPECT_TRUE(Validate(good).ok());
  struct Case {
    int Pattern::*field;
    int value;
    const char* name;
  };
  for (Case c : {Case{&Pattern::grid, 0, "grid"}, Case{&Pattern::grid, 1025, "grid"},
                 Case{&Pattern::influence, 16, "influence"}, Case{&Pattern::column, 3, "column"},
                 Case{&Pattern::row, 16, "row"}, Case{&Pattern::row, -1, "row"}}) {
    Pattern bad = good;
    bad.*c.field = c.value;
    absl::Status status = Validate(bad);
    EXPECT_EQ(ErrorReason(status), "PATTERN_INVALID");
    EXPECT_NE(status.message().find(c.name), std::string::npos) << status;
  }
}

TEST(PatternName, IsUniqueWithinASet) {
  EXPECT_EQ(
      PatternName({.arrangement = PatternArrangement::kSquare, .grid = 16, .column = 3, .row = 11}),
      "square-03-11");
  EXPECT_EQ(PatternName({.arrangement = PatternArrangement::kHorizontal,
                         .grid = 16,
                         .influence = 2,
                         .column = 1,
                         .row = 5}),
            "h-r05-o1-d2");
  std::set<std::string> names;
  for (auto arrangement : {PatternArrangement::kHorizontal, PatternArrangement::kVertical}) {
    for (const Pattern& p : Sets(16, 2, arrangement)) names.insert(PatternName(p));
  }
  EXPECT_EQ(names.size(), 96u);
}

}  // namespace
}  // namespace lightstage
