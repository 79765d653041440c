#include "sim/rig/sensor.h"

#include <gtest/gtest.h>

#include <cmath>

namespace lightstage::sim {
namespace {

SensorOptions Ideal() {
  SensorOptions sensor;
  sensor.sensitivity_e = 1000;  // so that an exposure of 1 is 1000 electrons
  sensor.full_well_e = 4095;    // one electron per code of 12 bits
  sensor.read_noise_e = 0;
  sensor.photon_noise = false;
  return sensor;
}

std::vector<int> Codes(const std::vector<std::byte>& data, PixelFormat format) {
  std::vector<int> codes;
  const int bytes = BytesPerSample(format);
  for (size_t i = 0; i < data.size(); i += bytes) {
    codes.push_back(static_cast<int>(data[i]) +
                    (bytes == 2 ? 256 * static_cast<int>(data[i + 1]) : 0));
  }
  return codes;
}

std::vector<int> Read(const Image& exposure, const SensorOptions& sensor, PixelFormat format,
                      uint64_t key = 1, double gain_db = 0) {
  return Codes(ReadSensor(exposure, sensor, format, 12, gain_db, key, 99), format);
}

struct Moments {
  double mean = 0, variance = 0;
};

Moments Measure(float exposure, const SensorOptions& sensor, uint64_t key = 5) {
  const Image image(400, 250, 3, exposure);
  const std::vector<int> codes = Read(image, sensor, PixelFormat::kMono16, key);
  Moments m;
  for (int c : codes) m.mean += c;
  m.mean /= static_cast<double>(codes.size());
  for (int c : codes) m.variance += (c - m.mean) * (c - m.mean);
  m.variance /= static_cast<double>(codes.size() - 1);
  return m;
}

TEST(Sensor, FormatsPickTheRightChannels) {
  Image image(2, 2, 3);
  for (int i = 0; i < 4; ++i) {  // pixel i: 0.1·(i+1) · (1, 2, 3)
    for (int c = 0; c < 3; ++c) image.at(i % 2, i / 2, c) = 0.1f * (i + 1) * (c + 1);
  }
  const SensorOptions sensor = Ideal();
  using V = std::vector<int>;
  EXPECT_EQ(Read(image, sensor, PixelFormat::kMono16), (V{200, 400, 600, 800}));
  EXPECT_EQ(Read(image, sensor, PixelFormat::kBayerRG16), (V{100, 400, 600, 1200}));
  EXPECT_EQ(Read(image, sensor, PixelFormat::kBayerGR16), (V{200, 200, 900, 800}));
  EXPECT_EQ(Read(image, sensor, PixelFormat::kBayerGB16), (V{200, 600, 300, 800}));
  EXPECT_EQ(Read(image, sensor, PixelFormat::kBayerBG16), (V{300, 400, 600, 400}));
  EXPECT_EQ(Read(image, sensor, PixelFormat::kRGB16),
            (V{100, 200, 300, 200, 400, 600, 300, 600, 900, 400, 800, 1200}));
  // 8 bits: 1200 electrons of 4095 are 74.7 of 255.
  EXPECT_EQ(Read(image, sensor, PixelFormat::kRGB8).back(), 75);
  EXPECT_EQ(Read(image, sensor, PixelFormat::kBayerRG8), (V{6, 25, 37, 75}));
}

TEST(Sensor, SaturatesAtFullWellAndNeverWraps) {
  SensorOptions sensor = Ideal();
  sensor.read_noise_e = 5;
  sensor.photon_noise = true;
  for (int code : Read(Image(64, 64, 3, 100.0f), sensor, PixelFormat::kRGB16)) {
    EXPECT_GE(code, 4095 - 25);
    EXPECT_LE(code, 4095);
  }
  for (int code : Read(Image(64, 64, 3, 100.0f), sensor, PixelFormat::kRGB8)) EXPECT_GE(code, 253);
  for (int code : Read(Image(64, 64, 3, 0.0f), sensor, PixelFormat::kRGB16)) EXPECT_LT(code, 25);
}

TEST(Sensor, PhotonNoiseIsPoisson) {
  SensorOptions sensor = Ideal();
  sensor.photon_noise = true;
  // 10⁵ pixels: the mean is good to 4·√(λ/10⁵), the variance to 4·√(2/10⁵) and a little for rare events at small λ.
  for (double electrons : {0.5, 4.0, 25.0, 35.0, 400.0, 2000.0}) {
    const Moments m = Measure(static_cast<float>(electrons / 1000), sensor);
    EXPECT_NEAR(m.mean, electrons, 4 * std::sqrt(electrons / 1e5)) << electrons;
    EXPECT_NEAR(m.variance / electrons, 1, 0.03) << electrons;
  }
}

TEST(Sensor, ReadNoiseAddsItsVariance) {
  SensorOptions sensor = Ideal();
  sensor.read_noise_e = 7;
  sensor.black_level = 100;  // so that nothing is clipped
  Moments dark = Measure(0, sensor);
  EXPECT_NEAR(dark.mean, 100, 0.1);
  EXPECT_NEAR(dark.variance, 49 + 1.0 / 12, 1);  // quantisation adds a twelfth
  sensor.photon_noise = true;
  Moments bright = Measure(0.5f, sensor);
  EXPECT_NEAR(bright.mean, 600, 0.4);
  EXPECT_NEAR(bright.variance, 500 + 49, 15);
}

TEST(Sensor, NoiseFollowsItsKey) {
  SensorOptions sensor = Ideal();
  sensor.photon_noise = true;
  sensor.read_noise_e = 3;
  const Image image(40, 30, 3, 0.4f);
  EXPECT_EQ(Read(image, sensor, PixelFormat::kRGB16, 1),
            Read(image, sensor, PixelFormat::kRGB16, 1));
  EXPECT_NE(Read(image, sensor, PixelFormat::kRGB16, 1),
            Read(image, sensor, PixelFormat::kRGB16, 2));
}

TEST(Sensor, GainAmplifiesBeforeTheConverter) {
  const Image image(1, 1, 3, 0.5f);
  EXPECT_EQ(Read(image, Ideal(), PixelFormat::kMono16, 1, 20 * std::log10(2.0)).front(), 1000);
  EXPECT_EQ(Read(image, Ideal(), PixelFormat::kMono16, 1, 24).front(), 4095);
}

TEST(Sensor, ResponseCurveBendsTheCodes) {
  SensorOptions sensor = Ideal();
  sensor.response = {0, 0.5, 1, 1};  // twice as steep up to two thirds of full well
  auto code = [&](double share) {
    return Read(Image(1, 1, 3, static_cast<float>(share * 4.095)), sensor, PixelFormat::kMono16)[0];
  };
  EXPECT_NEAR(code(1.0 / 6), 4095 * 0.25, 1);
  EXPECT_NEAR(code(0.5), 4095 * 0.75, 1);
  EXPECT_EQ(code(0.8), 4095);
}

// Photon transfer (EMVA 1288): the variance of the code over its mean is a line whose slope is the gain, codes per electron, and whose
// value in the dark is the read noise and the rounding.
TEST(Sensor, PhotonTransferGivesBackGainAndReadNoise) {
  SensorOptions sensor = Ideal();
  sensor.photon_noise = true;
  sensor.full_well_e = 10000;
  sensor.read_noise_e = 8;
  sensor.black_level = 100;
  const double gain = 4095 / sensor.full_well_e;
  double n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0;
  for (int i = 0; i <= 16; ++i) {
    const Moments m = Measure(0.5f * static_cast<float>(i), sensor, static_cast<uint64_t>(100 + i));
    const double x = m.mean - 100;
    ++n, sx += x, sy += m.variance, sxx += x * x, sxy += x * m.variance;
  }
  const double slope = (n * sxy - sx * sy) / (n * sxx - sx * sx), dark = (sy - slope * sx) / n;
  EXPECT_NEAR(slope / gain, 1, 0.01);
  EXPECT_NEAR(std::sqrt(dark - 1.0 / 12) / gain, sensor.read_noise_e, 0.6);
}

// The pattern is in every frame, the noise is not: in the mean of many frames the pattern is left.
TEST(Sensor, FixedPatternStaysWhileNoiseAveragesOut) {
  SensorOptions sensor = Ideal();
  sensor.dsnu_e = 20;
  sensor.prnu = 0.02;
  for (const auto& [exposure, expected] :
       {std::pair(0.5f, std::hypot(20, 10)), std::pair(2.0f, std::hypot(20, 40))}) {
    const Moments m = Measure(exposure, sensor);
    EXPECT_NEAR(std::sqrt(m.variance - 1.0 / 12) / expected, 1, 0.02) << exposure;
    EXPECT_NEAR(m.mean, exposure * 1000, 0.5);
    const Image image(40, 25, 3, exposure);
    EXPECT_EQ(Read(image, sensor, PixelFormat::kMono16, 1),
              Read(image, sensor, PixelFormat::kMono16, 2));
  }
}

}  // namespace
}  // namespace lightstage::sim
