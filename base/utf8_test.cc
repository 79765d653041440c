#include "base/utf8.h"

#include "gtest/gtest.h"

namespace lightstage {
namespace {

TEST(Utf8Test, CutsBetweenCharacters) {
  EXPECT_EQ(CutUtf8("abc", 3), "abc");
  EXPECT_EQ(CutUtf8("abcd", 3), "abc");
  EXPECT_EQ(CutUtf8("a\u00e9b", 2), "a");  // é has two bytes
  EXPECT_EQ(CutUtf8("a\u00e9b", 3), "a\u00e9");
  EXPECT_EQ(CutUtf8("\U0001f4a1", 3), "");  // a lamp has four
  EXPECT_EQ(CutUtf8("", 0), "");
}

TEST(Utf8Test, WhatIsNoUtf8IsReplaced) {
  EXPECT_EQ(CleanUtf8("caf\u00e9 \u2713 \U0001f4a1"), "caf\u00e9 \u2713 \U0001f4a1");
  EXPECT_EQ(CleanUtf8("caf\xe9"), "caf\ufffd");                          // Latin-1
  EXPECT_EQ(CleanUtf8("\xc0\xaf"), "\ufffd\ufffd");                      // overlong
  EXPECT_EQ(CleanUtf8("\xed\xa0\x80x"), "\ufffd\ufffd\ufffdx");          // a surrogate
  EXPECT_EQ(CleanUtf8("\xf4\x90\x80\x80"), "\ufffd\ufffd\ufffd\ufffd");  // above U+10FFFF
  EXPECT_EQ(CleanUtf8("a\xe2\x9c"), "a\ufffd\ufffd");                    // cut
}

}  // namespace
}  // namespace lightstage
