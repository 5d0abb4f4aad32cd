// SPDX-License-Identifier: Apache-2.0
#include "common/text/shortest_text.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <limits>

namespace rigcal::shortest_text_test {
namespace {

TEST(ShortestText, IsShort) {
  EXPECT_EQ(ShortestText(0.1), "0.1");
  EXPECT_EQ(ShortestText(25), "25");
  EXPECT_EQ(ShortestText(-1e-7), "-1e-07");
  EXPECT_EQ(ShortestText(std::numeric_limits<double>::infinity()), "inf");
}

TEST(ShortestText, ReadsBackAsTheSameNumber) {
  for (const double value : {0.1 + 0.2, 1.0 / 3, -4.9e-324, 1.7976931348623157e308}) {
    EXPECT_EQ(std::strtod(ShortestText(value).c_str(), nullptr), value);
  }
}

}  // namespace
}  // namespace rigcal::shortest_text_test
