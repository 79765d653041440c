#include "drivers/modbus/values.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace lightstage {
namespace {

using testing::ElementsAre;
using testing::Optional;

constexpr NumberFormat kU16{1, WordOrder::kHighFirst, false}, kI16{1, WordOrder::kHighFirst, true};
constexpr NumberFormat kHigh{2, WordOrder::kHighFirst, true}, kLow{2, WordOrder::kLowFirst, true};
constexpr NumberFormat kU32{2, WordOrder::kHighFirst, false};

TEST(Values, BothWordOrders) {
  // Oriental Motor AZ, HM-60262E, example of direct data operation: 8500 is 0000 2134.
  EXPECT_THAT(EncodeNumber(kHigh, 8500), Optional(ElementsAre(0x0000, 0x2134)));
  // Delta ASDA-A2 user manual (September 2012), p. 9-14: 3000 into 0112H is 0BB8 0000.
  EXPECT_THAT(EncodeNumber(kLow, 3000), Optional(ElementsAre(0x0BB8, 0x0000)));
  // MOONS' M2 user manual (rev. 1.0), p. 155: the registers 0026 25A0.
  const uint16_t words[] = {0x0026, 0x25A0};
  EXPECT_EQ(DecodeNumber(kHigh, words), 2500000);
  EXPECT_EQ(DecodeNumber(kLow, words), 0x25A00026);
}

TEST(Values, ComeBackAsTheyWereOverTheirWholeRange) {
  for (const NumberFormat& format : {kU16, kI16, kHigh, kLow, kU32}) {
    for (int64_t value : {Lowest(format), Lowest(format) + 1, int64_t{0}, int64_t{1},
                          int64_t{32767}, Highest(format) - 1, Highest(format)}) {
      auto words = EncodeNumber(format, value);
      ASSERT_TRUE(words.has_value()) << value;
      EXPECT_EQ(DecodeNumber(format, *words), value);
    }
    EXPECT_FALSE(EncodeNumber(format, Highest(format) + 1).has_value());
    EXPECT_FALSE(EncodeNumber(format, Lowest(format) - 1).has_value());
  }
}

TEST(Values, NegativeOnesAreTwosComplement) {
  EXPECT_THAT(EncodeNumber(kI16, -1), Optional(ElementsAre(0xFFFF)));
  EXPECT_THAT(EncodeNumber(kLow, -65536), Optional(ElementsAre(0x0000, 0xFFFF)));
}

TEST(Values, TooFewOrTooManyWordsAreNoNumber) {
  const uint16_t words[] = {1, 2, 3};
  EXPECT_FALSE(DecodeNumber(kHigh, std::span(words, 1)).has_value());
  EXPECT_FALSE(DecodeNumber(kHigh, words).has_value());
  EXPECT_FALSE(DecodeNumber(kU16, {}).has_value());
}

}  // namespace
}  // namespace lightstage
