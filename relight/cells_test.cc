#include "relight/cells.h"

#include <cmath>
#include <numbers>
#include <numeric>
#include <random>

#include "base/status.h"
#include "gtest/gtest.h"

namespace lightstage::relight {
namespace {

constexpr double kPi = std::numbers::pi;

// The dissertation's light stage: azimuths × tilts, cell-centred.
std::vector<Vec3> Grid(int azimuths, int tilts) {
  std::vector<Vec3> out;
  for (int a = 0; a < azimuths; ++a) {
    for (int t = 0; t < tilts; ++t) {
      out.push_back(
          DirectionFromAngles(Degrees(360.0 * a / azimuths), Degrees(90.0 * (t + 0.5) / tilts)));
    }
  }
  return out;
}

std::vector<Vec3> RandomDirections(int n, bool hemisphere, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(0, 1);
  std::vector<Vec3> out;
  for (int i = 0; i < n; ++i) {
    double z = hemisphere ? uniform(random) : 2 * uniform(random) - 1;
    out.push_back(DirectionFromAngles(Degrees(360 * uniform(random)), Radians(std::acos(z))));
  }
  return out;
}

EnvironmentMap Constant(int width, int height, float value = 1) {
  return *EnvironmentMap::FromImage(Image(width, height, 1, value));
}

EnvironmentMap RandomMap(int width, int height) {
  Image image(width, height, 3);
  std::mt19937 random(5);
  for (float& v : image.pixels()) v = std::uniform_real_distribution<float>(0, 4)(random);
  return *EnvironmentMap::FromImage(std::move(image));
}

Cells Integrate(const EnvironmentMap& map, const std::vector<Vec3>& directions,
                Angle rotate = Degrees(0)) {
  auto cells = IntegrateOverCells(map, directions, rotate);
  EXPECT_TRUE(cells.ok()) << cells.status();
  return *std::move(cells);
}

double Sum(const std::vector<double>& v) { return std::accumulate(v.begin(), v.end(), 0.0); }

size_t NearestByBruteForce(const std::vector<Vec3>& sites, const Vec3& d) {
  size_t best = 0;
  for (size_t i = 1; i < sites.size(); ++i) {
    if (sites[i].dot(d) > sites[best].dot(d)) best = i;
  }
  return best;
}

// n directions that represent equal solid angles of a cap from the zenith down to `z_min` (Fibonacci's spiral).
std::vector<Vec3> Spiral(int n, double z_min) {
  std::vector<Vec3> out;
  for (int i = 0; i < n; ++i) {
    double z = 1 - (1 - z_min) * (i + 0.5) / n;
    out.push_back(DirectionFromAngles(Radians(i * 2.399963229728653), Radians(std::acos(z))));
  }
  return out;
}

TEST(IntegrateOverCells, ConstantMapGivesSolidAngles) {
  for (auto [width, height] : {std::pair{64, 32}, {7, 5}, {4, 2}, {1, 1}}) {
    Cells upper = Integrate(Constant(width, height, 2), Grid(16, 6));
    EXPECT_TRUE(upper.upper_hemisphere_only);
    EXPECT_NEAR(Sum(upper.solid_angles), 2 * kPi, 1e-9);
    EXPECT_NEAR(upper.covered[0], 4 * kPi, 1e-9);
    EXPECT_NEAR(upper.left_out[0], 4 * kPi, 1e-6);
    Cells whole = Integrate(Constant(width, height), RandomDirections(100, false, 1));
    EXPECT_FALSE(whole.upper_hemisphere_only);
    EXPECT_NEAR(Sum(whole.solid_angles), 4 * kPi, 1e-9);
    EXPECT_EQ(whole.left_out[0], 0);
  }
}

TEST(IntegrateOverCells, CosineMapGivesPi) {
  Image image(128, 512, 1);
  for (int y = 0; y < 512; ++y) {
    for (int x = 0; x < 128; ++x)
      image.at(x, y, 0) = std::max(0.0, std::cos((y + 0.5) / 512 * kPi));
  }
  Cells cells = Integrate(*EnvironmentMap::FromImage(std::move(image)), Grid(32, 10));
  EXPECT_NEAR(cells.covered[1], kPi, 1e-4);
}

TEST(IntegrateOverCells, DividesExactlyWhatTheMapHolds) {
  EnvironmentMap map = RandomMap(60, 31);
  Cells cells = Integrate(map, Grid(32, 10), Degrees(33));
  Radiance sum = Radiance::Zero();
  for (const Radiance& w : cells.weights) sum += w;
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(sum[c] + cells.left_out[c], map.TotalPower()[c], 1e-9);
  }
}

// Closed form: meridians half-way between neighbours, and bisecting great circles tan θ = tan m / cos φ at middle tilts m, enclose
// 2 asin(sin(Δφ/2) cos m_top) − 2 asin(sin(Δφ/2) cos m_bottom).
TEST(IntegrateOverCells, RegularGridsAreasAreRight) {
  for (auto [azimuths, tilts, width, height] :
       {std::tuple{64, 20, 50, 25}, {32, 10, 256, 128}, {32, 10, 12, 6}}) {
    Cells cells = Integrate(Constant(width, height), Grid(azimuths, tilts));
    const double s = std::sin(kPi / azimuths);
    for (int a = 0; a < azimuths; ++a) {
      for (int t = 0; t < tilts; ++t) {
        double top = kPi / 2 * t / tilts, bottom = kPi / 2 * (t + 1) / tilts;
        double area = 2 * std::asin(s * std::cos(top)) - 2 * std::asin(s * std::cos(bottom));
        EXPECT_NEAR(cells.solid_angles[a * tilts + t] / area, 1, 1e-3)
            << azimuths << "×" << tilts << " on " << width << "×" << height << ", cell " << a
            << ", " << t;
      }
    }
  }
}

TEST(IntegrateOverCells, RandomSitesAgreeWithBruteForce) {
  const auto sites = RandomDirections(40, true, 7);
  EnvironmentMap map = RandomMap(24, 12);
  Cells cells = Integrate(map, sites);
  const int n = 200000;
  std::vector<double> areas(sites.size());
  std::vector<Radiance> weights(sites.size(), Radiance::Zero());
  double farthest = 0;
  for (const Vec3& d : Spiral(n, 0)) {
    size_t i = NearestByBruteForce(sites, d);
    areas[i] += 2 * kPi / n;
    weights[i] += 2 * kPi / n * map.Lookup(d);
    farthest = std::max(farthest, std::acos(sites[i].dot(d)));
  }
  for (size_t i = 0; i < sites.size(); ++i) {
    EXPECT_NEAR(cells.solid_angles[i], areas[i], 0.003 * areas[i] + 1e-4);
    for (int c = 0; c < 3; ++c)
      EXPECT_NEAR(cells.weights[i][c], weights[i][c], 0.003 * weights[i][c] + 1e-3);
  }
  EXPECT_NEAR(cells.farthest.radians(), farthest, 0.02);
}

// A swarm of lights inside one texel of a coarse map.
TEST(IntegrateOverCells, CellsNarrowerThanTexelsAreRight) {
  std::vector<Vec3> sites;
  for (const Vec3& d : RandomDirections(30, true, 3)) {
    sites.push_back((DirectionFromAngles(Degrees(100), Degrees(40)) + 0.03 * d).normalized());
  }
  sites.push_back(DirectionFromAngles(Degrees(280), Degrees(40)));
  Cells cells = Integrate(Constant(8, 4), sites);
  // Inside the swarm only: sampled densely around it.
  const int n = 300000;
  const Eigen::AngleAxisd tilt(Degrees(40).radians(), Vec3::UnitY());
  const double z_min = std::cos(0.08);
  std::vector<double> areas(sites.size());
  std::vector<bool> open(sites.size());
  open.back() = true;
  for (const Vec3& local : Spiral(n, z_min)) {
    size_t i = NearestByBruteForce(sites, RotateAboutZ(tilt * local, Degrees(100)));
    areas[i] += 2 * kPi * (1 - z_min) / n;
    if (local.z() < std::cos(0.075)) open[i] = true;  // reaches beyond what is sampled
  }
  int closed = 0;
  for (size_t i = 0; i < sites.size(); ++i) {
    if (open[i]) continue;
    ++closed;
    EXPECT_NEAR(cells.solid_angles[i] / areas[i], 1, 0.02);
  }
  EXPECT_GE(closed, 8);
}

TEST(IntegrateOverCells, TurningTheMapTurnsTheWeights) {
  const int azimuths = 16, tilts = 5, width = 64;
  EnvironmentMap map = RandomMap(width, 20);
  const auto grid = Grid(azimuths, tilts);
  Cells still = Integrate(map, grid);
  Cells turned = Integrate(map, grid, Degrees(3 * 360.0 / azimuths));
  // The texel picture itself turned, by as many columns; azimuth grows to the left.
  Image image(width, 20, 3);
  for (int y = 0; y < 20; ++y) {
    for (int x = 0; x < width; ++x) {
      Radiance r = map.At((x + 3 * width / azimuths) % width, y);
      for (int c = 0; c < 3; ++c) image.at(x, y, c) = r[c];
    }
  }
  Cells by_hand = Integrate(*EnvironmentMap::FromImage(std::move(image)), grid);
  for (int a = 0; a < azimuths; ++a) {
    for (int t = 0; t < tilts; ++t) {
      for (int c = 0; c < 3; ++c) {
        double before = still.weights[a * tilts + t][c];
        EXPECT_NEAR(turned.weights[(a + 3) % azimuths * tilts + t][c], before, 1e-3 * before);
        EXPECT_NEAR(by_hand.weights[(a + 3) % azimuths * tilts + t][c], before, 1e-3 * before);
      }
    }
  }
}

TEST(IntegrateOverCells, CoincidingDirectionsShareTheirCell) {
  auto grid = Grid(8, 4);
  Cells once = Integrate(Constant(16, 8), grid);
  grid.push_back(grid[5]);
  grid.push_back(grid[5]);
  Cells thrice = Integrate(Constant(16, 8), grid);
  EXPECT_NEAR(thrice.solid_angles[5], once.solid_angles[5] / 3, 1e-12);
  EXPECT_NEAR(thrice.solid_angles.back(), once.solid_angles[5] / 3, 1e-12);
  EXPECT_NEAR(thrice.solid_angles[6], once.solid_angles[6], 1e-12);
  EXPECT_NEAR(Sum(thrice.solid_angles), 2 * kPi, 1e-9);
}

TEST(IntegrateOverCells, FewDirections) {
  Cells one = Integrate(Constant(4, 2), {Vec3::UnitX()});
  EXPECT_NEAR(one.solid_angles[0], 2 * kPi, 1e-12);
  Cells two = Integrate(Constant(4, 2), {Vec3::UnitX(), -Vec3::UnitX()});
  EXPECT_NEAR(two.solid_angles[0], kPi, 1e-9);
  EXPECT_NEAR(two.farthest.degrees(), 90, 1);
  Cells down = Integrate(Constant(5, 3), {Vec3::UnitZ(), -Vec3::UnitZ()});
  EXPECT_NEAR(down.solid_angles[1], 2 * kPi, 1e-3);
  EXPECT_EQ(ErrorReason(IntegrateOverCells(Constant(4, 2), {}, Degrees(0)).status()),
            "NO_LIGHT_DIRECTIONS");
}

}  // namespace
}  // namespace lightstage::relight
