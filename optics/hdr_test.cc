#include "optics/hdr.h"

#include <cmath>
#include <cstring>
#include <vector>

#include "base/status.h"
#include "gtest/gtest.h"

namespace lightstage {
namespace {

std::span<const std::byte> Bytes(const std::vector<uint16_t>& codes) {
  return std::as_bytes(std::span(codes));
}
std::span<const std::byte> Bytes(const std::vector<uint8_t>& codes) {
  return std::as_bytes(std::span(codes));
}

struct Merged {
  std::vector<float> values;
  std::vector<uint8_t> marks;
};

Merged Merge(const std::vector<BracketFrame>& frames, int bytes, const CodeRange& range,
             const ResponseCurve& response = {}) {
  size_t n = frames.at(0).samples.size() / bytes;
  Merged out{std::vector<float>(n), std::vector<uint8_t>(n)};
  absl::Status status = MergeBracket(frames, bytes, range, response, out.values, out.marks);
  EXPECT_TRUE(status.ok()) << status;
  return out;
}

const CodeRange k12Bit{.full_scale = 4095, .black = 64, .low = 70, .high = 4000};

// A scene of 3500 samples over five decades, so that blocks, both ends and every exposure are met.
TEST(MergeBracket, RecoversASceneBeyondOneExposuresRange) {
  const std::vector<double> seconds = {0.001, 0.016, 0.25};
  std::vector<double> truth;
  for (int i = 0; i < 3500; ++i) truth.push_back(std::pow(10, -2 + 5.0 * i / 3499));
  std::vector<std::vector<uint16_t>> codes;
  std::vector<BracketFrame> frames;
  for (double s : seconds) {
    std::vector<uint16_t> frame;
    for (double e : truth) frame.push_back(std::lround(64 + std::min(1.0, e * s) * (4095 - 64)));
    codes.push_back(frame);
  }
  for (size_t j = 0; j < seconds.size(); ++j) frames.push_back({Bytes(codes[j]), seconds[j]});
  Merged merged = Merge(frames, 2, k12Bit);
  int measured = 0;
  for (size_t i = 0; i < truth.size(); ++i) {
    bool above = truth[i] * 0.001 * 4031 + 64 >= 3999.5;
    bool below = truth[i] * 0.25 * 4031 + 64 < 70.5;
    EXPECT_EQ(merged.marks[i], above ? kSampleAbove : below ? kSampleBelow : kSampleMeasured) << i;
    if (above) {
      EXPECT_GT(merged.values[i], 900);
      EXPECT_LE(merged.values[i], truth[i] * 1.001);  // a lower bound
    } else if (below) {
      EXPECT_EQ(merged.values[i], 0);
    } else {
      // Half a code of rounding at the lowest codes, far less above.
      EXPECT_NEAR(merged.values[i] / truth[i], 1, 0.09) << truth[i];
      if (truth[i] > 1) {
        EXPECT_NEAR(merged.values[i] / truth[i], 1, 0.005) << truth[i];
      }
      ++measured;
    }
  }
  EXPECT_GT(measured, 3000);
}

TEST(MergeBracket, SamplesAtTheEndsWeighNothing) {
  // Second exposure says 0.5 per second; the first one is at, or beyond, an end.
  const std::vector<uint16_t> middle = {2079};  // (2079−64)/4031/1 s = 0.49988
  for (uint16_t end : {0, 64, 70, 4000, 4095}) {
    const std::vector<uint16_t> ends = {end};
    Merged merged = Merge({{Bytes(ends), 0.5}, {Bytes(middle), 1.0}}, 2, k12Bit);
    EXPECT_EQ(merged.marks[0], kSampleMeasured);
    EXPECT_FLOAT_EQ(merged.values[0], 2015.0f / 4031) << end;
  }
}

TEST(MergeBracket, WeighsByAHat) {
  // Codes 1070 and 2070 over (70, 4000): weights 1000 and 1930.
  const std::vector<uint16_t> a = {1070}, b = {2070};
  Merged merged = Merge({{Bytes(a), 1.0}, {Bytes(b), 2.0}}, 2, k12Bit);
  double expected = (1000 * (1006 / 4031.0) + 1930 * (2006 / 4031.0 / 2)) / 2930;
  EXPECT_NEAR(merged.values[0], expected, 1e-6);
}

TEST(MergeBracket, BlackAndSaturatedAreKeptApart) {
  const std::vector<uint8_t> shorter = {0, 255, 0}, longer = {0, 255, 255};
  CodeRange range;
  Merged merged = Merge({{Bytes(shorter), 0.01}, {Bytes(longer), 0.1}}, 1, range);
  EXPECT_EQ(merged.marks, (std::vector<uint8_t>{kSampleBelow, kSampleAbove, kSampleAbove}));
  EXPECT_EQ(merged.values[0], 0);
  EXPECT_FLOAT_EQ(merged.values[1], 100);  // at least full scale in the shortest exposure
  EXPECT_FLOAT_EQ(merged.values[2],
                  10);  // in the gap between the two: at least what saturates the longer
}

TEST(MergeBracket, UsesTheResponseTable) {
  std::vector<double> g(256);
  for (int z = 0; z < 256; ++z) g[z] = 2.2 * std::log(std::max(z, 1) / 255.0);
  ResponseCurve curve = *ResponseCurve::FromTable(g);
  std::vector<uint8_t> shorter, longer;
  std::vector<double> truth;
  for (int i = 1; i <= 40; ++i) {
    double e = i * 0.2;
    truth.push_back(e);
    auto code = [](double x) {
      return uint8_t(std::lround(255 * std::pow(std::min(x, 1.0), 1 / 2.2)));
    };
    shorter.push_back(code(e * 0.1));
    longer.push_back(code(e * 0.4));
  }
  Merged merged = Merge({{Bytes(shorter), 0.1}, {Bytes(longer), 0.4}}, 1, CodeRange{}, curve);
  for (size_t i = 0; i < truth.size(); ++i) EXPECT_NEAR(merged.values[i] / truth[i], 1, 0.02);
}

TEST(MergeBracket, RefusesBadInput) {
  const std::vector<uint8_t> codes = {1, 2, 3};
  std::vector<float> values(3);
  std::vector<uint8_t> marks(3);
  auto reason = [&](std::vector<BracketFrame> frames, CodeRange range,
                    const ResponseCurve& curve = {}) {
    return ErrorReason(MergeBracket(frames, 1, range, curve, values, marks));
  };
  EXPECT_EQ(reason({{Bytes(codes), 1}}, {}), "OK");
  EXPECT_EQ(reason({}, {}), "BRACKET_INVALID");
  EXPECT_EQ(reason({{Bytes(codes).first(2), 1}}, {}), "BRACKET_INVALID");
  EXPECT_EQ(reason({{Bytes(codes), 0}}, {}), "BRACKET_INVALID");
  EXPECT_EQ(reason({{Bytes(codes), std::nan("")}}, {}), "BRACKET_INVALID");
  EXPECT_EQ(reason({{Bytes(codes), 1}}, {.low = 200, .high = 100}), "BRACKET_INVALID");
  EXPECT_EQ(reason({{Bytes(codes), 1}}, {}, *ResponseCurve::FromTable({0, 1})), "BRACKET_INVALID");
}

}  // namespace
}  // namespace lightstage
