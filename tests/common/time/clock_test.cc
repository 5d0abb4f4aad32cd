// SPDX-License-Identifier: Apache-2.0
#include "common/time/clock.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <vector>

namespace rigcal::clock_test {
namespace {

using ::testing::ElementsAre;

std::vector<uint32_t> EpochsOf(const std::vector<int64_t>& times_ns) {
  ClockEpochCounter counter;
  std::vector<uint32_t> epochs;
  for (const int64_t time_ns : times_ns) epochs.push_back(counter.EpochOf(time_ns));
  return epochs;
}

TEST(ClockEpochCounter, StaysInTheEpochWhileTimeDoesNotFall) {
  EXPECT_THAT(EpochsOf({5, 6, 6, 1000000}), ElementsAre(0u, 0u, 0u, 0u));
}

TEST(ClockEpochCounter, OpensAnEpochAtEveryStepBack) {
  EXPECT_THAT(EpochsOf({10, 20, 19, 21, 30, 1, 2}), ElementsAre(0u, 0u, 1u, 1u, 1u, 2u, 2u));
}

TEST(ClockEpochCounter, DoesNotGoBackToAnOldEpoch) {
  EXPECT_THAT(EpochsOf({10, 20, 5, 25}), ElementsAre(0u, 0u, 1u, 1u));
}

TEST(ClockEpochCounter, TakesTheWholeRangeOfTimes) {
  EXPECT_THAT(EpochsOf({-5, -4, std::numeric_limits<int64_t>::max(),
                        std::numeric_limits<int64_t>::min(), -5}),
              ElementsAre(0u, 0u, 0u, 1u, 1u));
}

}  // namespace
}  // namespace rigcal::clock_test
