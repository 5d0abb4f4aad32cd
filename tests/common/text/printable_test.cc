// SPDX-License-Identifier: Apache-2.0
#include "common/text/printable.h"

#include <gtest/gtest.h>

#include <string>

#include "common/text/utf8.h"

namespace rigcal::printable_test {
namespace {

TEST(Printable, LeavesTextAsItIs) {
  for (const char* text : {"", "left camera", "Kamera \u00fcber \u4e2d\u6587 \U0001f4f7", "a\\n"}) {
    EXPECT_EQ(Printable(text), text);
    EXPECT_EQ(PrintableLines(text), text);
  }
}

TEST(Printable, EscapesWhatForgesLinesAndTerminals) {
  EXPECT_EQ(Printable("a\nb\r\tc"), "a\\nb\\r\\tc");
  EXPECT_EQ(Printable("\x1b[31m"), "\\x1b[31m");
  EXPECT_EQ(Printable(std::string("a\0b", 3)), "a\\x00b");
  EXPECT_EQ(Printable("\x7f"), "\\x7f");
  EXPECT_EQ(Printable("\u009b31m"), "\\x9b31m");  // the one-byte form of escape and bracket
  for (const char* text : {"\u202a", "\u202e", "\u2066", "\u2069", "\u200f", "\u061c", "\u2028",
                           "\u2029", "\ufeff", "\u200b", "\U000e0041"}) {
    const std::string escaped = Printable(text);
    EXPECT_EQ(escaped.front(), '\\') << escaped;
    EXPECT_EQ(escaped.find(text), std::string::npos);
  }
}

TEST(Printable, LinesKeepTheirEnds) { EXPECT_EQ(PrintableLines("a\nb\x1b\n"), "a\nb\\x1b\n"); }

TEST(Printable, BytesThatAreNoUtf8AreShown) {
  EXPECT_EQ(Printable("a\xff"), "a\\xff");
  EXPECT_EQ(Printable("\xe2\x82"), "\\xe2\\x82");           // cut off
  EXPECT_EQ(Printable("\xc0\x8a"), "\\xc0\\x8a");           // overlong newline
  EXPECT_EQ(Printable("\xed\xa0\x80"), "\\xed\\xa0\\x80");  // surrogate
}

TEST(Printable, AnyBytesGivePrintableUtf8) {
  for (int first = 0; first < 256; ++first) {
    for (int second = 0; second < 256; ++second) {
      const std::string text = {static_cast<char>(first), static_cast<char>(second), 'x'};
      const std::string shown = Printable(text);
      EXPECT_TRUE(IsUtf8(shown));
      for (const char c : shown) EXPECT_FALSE(static_cast<unsigned char>(c) < 0x20 || c == 0x7f);
      EXPECT_EQ(Printable(shown), shown);
    }
  }
}

TEST(Beginning, DoesNotCutACharacter) {
  EXPECT_EQ(Beginning("abc", 5), "abc");
  EXPECT_EQ(Beginning("abc", 2), "ab");
  EXPECT_EQ(Beginning("a\u4e2d", 3), "a");
  EXPECT_EQ(Beginning("a\u4e2d", 4), "a\u4e2d");
  EXPECT_EQ(Beginning("\u4e2d", 1), "");
}

}  // namespace
}  // namespace rigcal::printable_test
