#include "optics/response.h"

#include <cmath>
#include <limits>

#include "base/status.h"
#include "gtest/gtest.h"

namespace lightstage {
namespace {

TEST(ResponseCurve, LinearMapsFullScaleToOne) {
  ResponseCurve curve;
  EXPECT_TRUE(curve.is_linear());
  EXPECT_DOUBLE_EQ(curve.Exposure(4095, 4095), 1);
  EXPECT_DOUBLE_EQ(curve.Exposure(1023.75, 4095), 0.25);
}

// A camera with gamma 2.2: Z/255 = (EΔt)^(1/2.2), so exp(g(Z)) ∝ (Z/255)^2.2.
TEST(ResponseCurve, TableInvertsAGamma) {
  std::vector<double> g(256);
  for (int z = 0; z < 256; ++z) g[z] = 2.2 * std::log(std::max(z, 1) / 127.0);
  auto curve = ResponseCurve::FromTable(g);
  ASSERT_TRUE(curve.ok());
  EXPECT_EQ(curve->levels(), 256);
  EXPECT_NEAR(curve->Exposure(127, 255), 1, 1e-12);
  EXPECT_NEAR(curve->Exposure(254, 255), std::pow(2, 2.2), 1e-9);
  EXPECT_NEAR(curve->LogExposure(100.5), (g[100] + g[101]) / 2, 1e-12);
  EXPECT_EQ(curve->LogExposure(300), g[255]);
}

TEST(ResponseCurve, RefusesWhatIsNoCurve) {
  for (std::vector<double> bad : {std::vector<double>{},
                                  {1.0},
                                  {0.0, 1.0, 2.0},
                                  {0.0, 1.0, 0.5, 2.0},
                                  {0.0, std::numeric_limits<double>::quiet_NaN()},
                                  {-std::numeric_limits<double>::infinity(), 0.0}}) {
    EXPECT_EQ(ErrorReason(ResponseCurve::FromTable(bad).status()), "RESPONSE_CURVE");
  }
}

}  // namespace
}  // namespace lightstage
