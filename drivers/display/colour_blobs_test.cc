#include "drivers/display/colour_blobs.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <functional>
#include <vector>

namespace lightstage {
namespace {

bool Straight(size_t size, const std::function<double(double x, int c)>& of) {
  std::vector<uint16_t> table;
  for (size_t i = 0; i < size; ++i) {
    const double x = size > 1 ? static_cast<double>(i) / static_cast<double>(size - 1) : 0;
    for (int c = 0; c < 3; ++c) table.push_back(static_cast<uint16_t>(65535 * of(x, c)));
    table.push_back(0xabcd);
  }
  return IsStraightBlob(std::as_bytes(std::span(table)));
}

TEST(ColourBlobs, TablesThatLeaveCodesAreStraight) {
  for (size_t size : {2u, 256u, 1024u, 4096u}) {
    EXPECT_TRUE(Straight(size, [](double x, int) { return x; })) << size;
  }
  std::vector<ColourEntry> made;
  for (size_t i = 0; i < 1024; ++i) {
    const uint16_t entry = StraightEntry(i, 1024);
    made.push_back({entry, entry, entry, 0});
  }
  EXPECT_TRUE(IsStraight(made));
  EXPECT_EQ(made.back()[0], 65535);
  // As the kernel fills one of 256: i << 8.
  EXPECT_TRUE(Straight(256, [](double x, int) { return x * 65280 / 65535; }));
}

TEST(ColourBlobs, OthersAreNot) {
  for (double gamma : {1.1, 1.01, 0.99}) {
    EXPECT_FALSE(Straight(256, [&](double x, int) { return std::pow(x, gamma); })) << gamma;
    EXPECT_FALSE(Straight(4096, [&](double x, int) { return std::pow(x, gamma); })) << gamma;
  }
  EXPECT_FALSE(Straight(256, [](double x, int) { return std::min(1.0, x + 1.0 / 256); }));
  EXPECT_FALSE(Straight(1024, [](double x, int c) { return c == 2 ? 0.8 * x : x; })) << "evening";
  EXPECT_FALSE(Straight(256, [](double x, int) { return 1 - x; }));
  EXPECT_FALSE(Straight(2, [](double, int) { return 0.0; }));
  EXPECT_FALSE(Straight(1, [](double x, int) { return x; }));
  EXPECT_FALSE(IsStraightBlob({}));
}

TEST(ColourBlobs, OnlyTheIdentityIsOne) {
  std::vector<uint64_t> matrix(9, 0);
  for (size_t i : {0, 4, 8}) matrix[i] = uint64_t{1} << 32;
  EXPECT_TRUE(IsIdentityBlob(std::as_bytes(std::span(matrix))));
  EXPECT_FALSE(IsIdentityBlob(std::as_bytes(std::span(matrix)).first(64)));
  for (size_t i = 0; i < 9; ++i) {
    std::vector<uint64_t> other = matrix;
    other[i] ^= uint64_t{1} << 63;  // minus
    EXPECT_FALSE(IsIdentityBlob(std::as_bytes(std::span(other)))) << i;
  }
}

}  // namespace
}  // namespace lightstage
