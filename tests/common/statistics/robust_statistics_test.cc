// SPDX-License-Identifier: Apache-2.0
#include "common/statistics/robust_statistics.h"

#include <gtest/gtest.h>

#include <array>

namespace rigcal::robust_statistics_test {
namespace {

using Values = std::vector<double>;

TEST(RobustStatistics, MediansDifferOnlyForAnEvenCount) {
  EXPECT_EQ(Median({5}), 5);
  EXPECT_EQ(UpperMedian(Values{5}), 5);
  EXPECT_EQ(LowerMedian(Values{5}), 5);
  EXPECT_EQ(Median({9, 1, 5}), 5);
  EXPECT_EQ(UpperMedian(Values{9, 1, 5}), 5);
  EXPECT_EQ(LowerMedian(Values{9, 1, 5}), 5);
  EXPECT_EQ(Median({9, 1, 5, 6}), 5.5);
  EXPECT_EQ(UpperMedian(Values{9, 1, 5, 6}), 6);
  EXPECT_EQ(LowerMedian(Values{9, 1, 5, 6}), 5);
}

TEST(RobustStatistics, QuantilesRoundTheirPosition) {
  Values values = {40, 10, 30, 20};  // positions 0 to 3
  EXPECT_EQ(LowerQuantile(&values, 0.6), 20);
  EXPECT_EQ(UpperQuantile(&values, 0.6), 30);
  EXPECT_EQ(NearestQuantile(&values, 0.6), 30);
  EXPECT_EQ(NearestQuantile(&values, 0.4), 20);
  EXPECT_DOUBLE_EQ(InterpolatedQuantile(values, 0.6), 28);
  for (const double share : {0.0, 1.0}) {
    const double expected = share == 0 ? 10 : 40;
    EXPECT_EQ(LowerQuantile(&values, share), expected);
    EXPECT_EQ(UpperQuantile(&values, share), expected);
    EXPECT_EQ(NearestQuantile(&values, share), expected);
    EXPECT_EQ(InterpolatedQuantile(values, share), expected);
  }
}

TEST(RobustStatistics, InterpolatedQuantileOfNothingIsNotANumber) {
  EXPECT_TRUE(std::isnan(InterpolatedQuantile({}, 0.5)));
}

TEST(RobustStatistics, HistogramQuantileIsTheBinThatReachesTheShare) {
  const std::array<int64_t, 5> counts = {0, 2, 0, 6, 2};
  EXPECT_EQ(HistogramQuantile(counts, 0), 1);
  EXPECT_EQ(HistogramQuantile(counts, 0.2), 1);
  EXPECT_EQ(HistogramQuantile(counts, 0.21), 3);
  EXPECT_EQ(HistogramQuantile(counts, 1), 4);
  EXPECT_EQ(HistogramQuantile(std::array<int64_t, 3>{}, 0.5), 2);
}

}  // namespace
}  // namespace rigcal::robust_statistics_test
