// SPDX-License-Identifier: Apache-2.0
#include "client/output/grade_colour.h"

#include <gtest/gtest.h>

namespace rigcal::client::grade_colour_test {
namespace {

TEST(ColourGrades, TheLineOfTheQuality) {
  EXPECT_EQ(ColourGrades("a\n\nQuality: good\n  all good\n"),
            "a\n\nQuality: \x1b[32mgood\x1b[0m\n  all good\n");
  EXPECT_EQ(ColourGrades("Quality: bad"), "Quality: \x1b[31mbad\x1b[0m");
  EXPECT_EQ(ColourGrades("Quality: not graded\n"), "Quality: not graded\n");
}

TEST(ColourGrades, TheColumnOfATable) {
  EXPECT_EQ(ColourGrades("calibration  quality  created\n"
                         "good         usable   good\n"
                         "ü            bad      x\n"
                         "\n"
                         "x            bad      x\n"),
            "calibration  quality  created\n"
            "good         \x1b[33musable\x1b[0m   good\n"
            "ü            \x1b[31mbad\x1b[0m      x\n"
            "\n"
            "x            bad      x\n");
}

TEST(ColourGrades, OtherTextStays) {
  const std::string text = "the quality of it is good\nthe bad one\n";
  EXPECT_EQ(ColourGrades(text), text);
}

}  // namespace
}  // namespace rigcal::client::grade_colour_test
