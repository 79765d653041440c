#include "base/strings.h"

#include "gtest/gtest.h"

namespace lightstage {
namespace {

TEST(CutUtf8Test, CutsBetweenCharacters) {
  EXPECT_EQ(CutUtf8("abc", 3), "abc");
  EXPECT_EQ(CutUtf8("abcd", 3), "abc");
  EXPECT_EQ(CutUtf8("a\u00e9b", 2), "a");  // é has two bytes
  EXPECT_EQ(CutUtf8("a\u00e9b", 3), "a\u00e9");
  EXPECT_EQ(CutUtf8("\U0001f4a1", 3), "");  // a lamp has four
  EXPECT_EQ(CutUtf8("", 0), "");
}

}  // namespace
}  // namespace lightstage
