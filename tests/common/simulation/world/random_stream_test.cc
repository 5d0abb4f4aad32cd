// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/world/random_stream.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

namespace rigcal::random_stream_test {
namespace {

TEST(RandomStream, FollowsFromItsKeyAlone) {
  RandomStream a{1, 2, 3};
  RandomStream b{1, 2, 3};
  for (int i = 0; i < 100; ++i) EXPECT_EQ(a.Bits(), b.Bits());
}

TEST(RandomStream, NearbyAndPermutedKeysShareNothing) {
  std::set<uint64_t> seen;
  for (uint64_t i = 0; i < 50; ++i) {
    for (uint64_t j = 0; j < 50; ++j) seen.insert((RandomStream{i, j}).Bits());
  }
  EXPECT_EQ(seen.size(), 2500u);
}

// Bounds are five sigma of the mean of so many draws.
TEST(RandomStream, NumbersHaveTheirDistributions) {
  constexpr int kCount = 100000;
  double uniform_sum = 0, gaussian_sum = 0, gaussian_squares = 0;
  for (int i = 0; i < kCount; ++i) {
    RandomStream stream{9, static_cast<uint64_t>(i)};
    const double uniform = stream.Uniform();
    ASSERT_GE(uniform, 0);
    ASSERT_LT(uniform, 1);
    uniform_sum += uniform;
    const double gaussian = stream.Gaussian();
    ASSERT_TRUE(std::isfinite(gaussian));
    gaussian_sum += gaussian;
    gaussian_squares += gaussian * gaussian;
  }
  EXPECT_NEAR(uniform_sum / kCount, 0.5, 5 * 0.2887 / std::sqrt(kCount));
  EXPECT_NEAR(gaussian_sum / kCount, 0, 5 / std::sqrt(kCount));
  EXPECT_NEAR(gaussian_squares / kCount, 1, 5 * std::sqrt(2.0 / kCount));
}

TEST(RandomStream, StaysBetweenItsBounds) {
  RandomStream stream{4};
  for (int i = 0; i < 1000; ++i) {
    const double value = stream.Uniform(-3, -2);
    ASSERT_GE(value, -3);
    ASSERT_LT(value, -2);
  }
}

}  // namespace
}  // namespace rigcal::random_stream_test
