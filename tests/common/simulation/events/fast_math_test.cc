// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/events/fast_math.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace rigcal::fast_math_test {
namespace {

TEST(FastMath, LogIsRightOverAllNormalNumbers) {
  for (double x = 2e-38; x < 1e38; x *= 1.0007) {
    const auto argument = static_cast<float>(x);
    const double expected = std::log(static_cast<double>(argument));
    ASSERT_NEAR(FastLog(argument), expected, 2e-7 * std::max(1.0, std::abs(expected))) << argument;
  }
  EXPECT_EQ(FastLog(1), 0);
}

TEST(FastMath, ExpIsRight) {
  for (double x = -87; x < 87; x += 0.0013) {
    const auto argument = static_cast<float>(x);
    const double expected = std::exp(static_cast<double>(argument));
    ASSERT_NEAR(FastExpWithin87(argument) / expected, 1, 5e-6) << argument;
  }
  EXPECT_EQ(FastExpWithin87(0), 1);
}

TEST(FastMath, DecayEndsNearNothing) {
  EXPECT_EQ(FastDecay(0), 1);
  EXPECT_NEAR(FastDecay(2), std::exp(-2), 1e-6);
  EXPECT_GT(FastDecay(1e30f), 0);
  EXPECT_LT(FastDecay(1e30f), 1e-37);
}

}  // namespace
}  // namespace rigcal::fast_math_test
