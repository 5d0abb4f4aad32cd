// SPDX-License-Identifier: Apache-2.0
#include "common/text/utf8.h"

#include <gtest/gtest.h>

#include <string>

namespace rigcal::testing::utf8_test {
namespace {

TEST(IsUtf8, TakesEveryLength) {
  EXPECT_TRUE(IsUtf8(""));
  EXPECT_TRUE(IsUtf8("rig-1"));
  EXPECT_TRUE(IsUtf8("\xC3\xBC"));                           // u with diaeresis
  EXPECT_TRUE(IsUtf8("\xE2\x82\xAC \xEF\xBF\xBF"));          // euro, U+FFFF
  EXPECT_TRUE(IsUtf8("\xF0\x9F\x93\xB7 \xF4\x8F\xBF\xBF"));  // camera, U+10FFFF
  EXPECT_TRUE(IsUtf8("\xED\x9F\xBF \xEE\x80\x80"));          // around the surrogates
  EXPECT_TRUE(IsUtf8(std::string_view("a\0b", 3)));
}

TEST(IsUtf8, RefusesWhatIsCutOverlongOrOutOfRange) {
  for (const std::string text :
       {"\x80", "\xC3", "a\xC3", "\xC3(", "\xC0\xAF", "\xC1\xBF", "\xE0\x9F\xBF", "\xE2\x82",
        "\xE2\x28\xA1", "\xED\xA0\x80", "\xF0\x8F\xBF\xBF", "\xF0\x9F\x93", "\xF4\x90\x80\x80",
        "\xF5\x80\x80\x80", "\xFF"}) {
    EXPECT_FALSE(IsUtf8(text)) << ::testing::PrintToString(text);
  }
}

}  // namespace
}  // namespace rigcal::testing::utf8_test
