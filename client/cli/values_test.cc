#include "client/cli/values.h"

#include "base/status.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace lightstage::client {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

template <class T>
std::string Reason(const absl::StatusOr<T>& value) {
  return value.ok() ? "OK" : ErrorReason(value.status());
}

TEST(ParseNumber, TakesFiniteNumbersOnly) {
  EXPECT_EQ(*ParseNumber("-4.5e2"), -450);
  for (const char* text : {"", "nan", "NaN", "inf", "-inf", "1e999", "1,5", "1 ", "0x10", "4deg"}) {
    EXPECT_EQ(Reason(ParseNumber(text)), "USAGE") << text;
  }
}

TEST(ParseDuration, IsNeverNegativeOrEndless) {
  EXPECT_EQ(*ParseDuration("0.25"), 0.25);
  for (const char* text : {"-1", "1e10", "inf"}) {
    EXPECT_EQ(Reason(ParseDuration(text)), "USAGE") << text;
  }
}

TEST(ParseInteger, TakesWholeNumbersOnly) {
  EXPECT_EQ(*ParseInteger("-3"), -3);
  for (const char* text : {"", "2.5", "1e3", "2147483648", " 1", "1 "}) {
    EXPECT_EQ(Reason(ParseInteger(text)), "USAGE") << text;
  }
}

TEST(ParseNumbers, KeepsTheOrder) {
  EXPECT_THAT(*ParseNumbers("4000,500,0.5"), ElementsAre(4000, 500, 0.5));
  EXPECT_EQ(Reason(ParseNumbers("500,,4000")), "USAGE");
  EXPECT_EQ(Reason(ParseNumbers("500,")), "USAGE");
}

TEST(ParseCountOrAngles, ACommaOrADecimalPointMakesAngles) {
  EXPECT_EQ(std::get<int>(*ParseCountOrAngles("32")), 32);
  EXPECT_THAT(std::get<std::vector<double>>(*ParseCountOrAngles("45.")), ElementsAre(45));
  EXPECT_THAT(std::get<std::vector<double>>(*ParseCountOrAngles("0,-15,30")),
              ElementsAre(0, -15, 30));
  EXPECT_EQ(Reason(ParseCountOrAngles("all")), "USAGE");
  EXPECT_EQ(Reason(ParseCountOrAngles("0,nan")), "USAGE");
}

TEST(ParseLamps, TakesListsOfRanges) {
  EXPECT_THAT(*ParseLamps("0,3,7-9"), ElementsAre(0, 3, 7, 8, 9));
  EXPECT_THAT(*ParseLamps("5-5"), ElementsAre(5));
  EXPECT_THAT(*ParseLamps("all"), IsEmpty());
  for (const char* text : {"", "9-7", "-1", "1-", "-", "1--2", "1-2-3", "a", "all,1",
                           "0-2000000000", "0-99999,0-99999"}) {
    EXPECT_EQ(Reason(ParseLamps(text)), "USAGE") << text;
  }
}

TEST(ParseLampLevels, TakesRangesToo) {
  auto levels = ParseLampLevels("3=1.0,7-8=0.5");
  ASSERT_TRUE(levels.ok()) << levels.status();
  ASSERT_EQ(levels->size(), 3u);
  EXPECT_EQ((*levels)[0].lamp(), 3);
  EXPECT_EQ((*levels)[0].level(), 1);
  EXPECT_EQ((*levels)[2].lamp(), 8);
  EXPECT_EQ((*levels)[2].level(), 0.5);
  for (const char* text : {"", "3", "3=", "=1", "3=nan", "3=1=2", "all=1", "off"}) {
    EXPECT_EQ(Reason(ParseLampLevels(text)), "USAGE") << text;
  }
}

TEST(ParsePattern, TakesAnArrangementAndItsFields) {
  auto pattern = ParsePattern("horizontal,grid=32,row=3,column=1,influence=2,profile=hat");
  ASSERT_TRUE(pattern.ok()) << pattern.status();
  EXPECT_EQ(pattern->arrangement(), v1::PATTERN_ARRANGEMENT_HORIZONTAL);
  EXPECT_EQ(pattern->grid(), 32);
  EXPECT_EQ(pattern->row(), 3);
  EXPECT_EQ(pattern->column(), 1);
  EXPECT_EQ(pattern->influence(), 2);
  EXPECT_EQ(pattern->profile(), v1::PATTERN_PROFILE_HAT);
  EXPECT_EQ(ParsePattern("full")->grid(), 16);
  for (const char* text : {"", "unspecified", "grid=16", "square,grid", "square,grid=x",
                           "square,colour=3", "square,profile=round", "square,7", "full,grid=3",
                           "square,row=8,row=7", "black,profile=box"}) {
    EXPECT_EQ(Reason(ParsePattern(text)), "USAGE") << text;
  }
}

TEST(ParsePattern, SaysWhichNumberIsWrong) {
  EXPECT_THAT(ParsePattern("square,grid=4294967298").status().message(),
              testing::HasSubstr("grid: '4294967298' is no whole number"));
}

TEST(ParseRun, TakesNamesAndIds) {
  EXPECT_EQ(*ParseRun("runs/20261123-a"), "runs/20261123-a");
  EXPECT_EQ(*ParseRun("20261123-a"), "runs/20261123-a");
  EXPECT_EQ(*ParseRun("latest"), "latest");
  for (const char* text : {"", "runs/", "runs/a/b", "a b", "../a"}) {
    EXPECT_EQ(Reason(ParseRun(text)), "USAGE") << text;
  }
}

TEST(ParseAxisAndProfile, KnowTheirNames) {
  EXPECT_EQ(*ParseAxis("tilt"), v1::AXIS_ID_TILT);
  EXPECT_EQ(Reason(ParseAxis("gantry")), "USAGE");
  EXPECT_EQ(*ParseProfile("gaussian"), v1::PATTERN_PROFILE_GAUSSIAN);
  EXPECT_EQ(Reason(ParseProfile("Gaussian")), "USAGE");
}

}  // namespace
}  // namespace lightstage::client
