// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>

#include "common/simulation/events/event_pixels.h"

namespace rigcal::normal_quantiles_test {
namespace {

TEST(NormalQuantiles, HaveTheMomentsAndTailsOfANormalDistribution) {
  const NormalQuantiles normal;
  double sum = 0, squares = 0, fourth = 0;
  int beyond_two = 0;
  for (uint64_t i = 0; i < 4096; ++i) {
    const double value = normal.At(i);
    sum += value;
    squares += value * value;
    fourth += std::pow(value, 4);
    beyond_two += std::abs(value) > 2 ? 1 : 0;
  }
  EXPECT_NEAR(sum, 0, 1e-3);
  EXPECT_NEAR(squares / 4096, 1, 0.002);
  EXPECT_NEAR(fourth / 4096, 3, 0.03);
  EXPECT_NEAR(beyond_two / 4096.0, 0.0455, 0.0005);
  EXPECT_NEAR(normal.At(4095), 3.67, 0.01);
  EXPECT_EQ(normal.At(0), -normal.At(4095));
  EXPECT_EQ(normal.At(5 * 4096 + 7), normal.At(7));
}

}  // namespace
}  // namespace rigcal::normal_quantiles_test
