// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/held_out_choice.h"

#include <gtest/gtest.h>

#include <cmath>

namespace rigcal::server::held_out_choice_test {
namespace {

constexpr int64_t kSecond = 1'000'000'000;

TEST(LongBlocks, AreATwelfthAndAtLeastTwoSeconds) {
  const TimeBlocks of_minutes = LongBlocks(5 * kSecond, 185 * kSecond);
  EXPECT_NEAR(1e-9 * static_cast<double>(of_minutes.block_ns), 15, 1e-6);
  EXPECT_EQ(CountBlocks(of_minutes, 185 * kSecond), 12);
  const TimeBlocks of_seconds = LongBlocks(0, 9 * kSecond);
  EXPECT_EQ(of_seconds.block_ns, 2 * kSecond);
  EXPECT_EQ(CountBlocks(of_seconds, 9 * kSecond), 5);
}

TEST(CompareByBlock, IsThePairedDifferenceAndItsStandardError) {
  const HeldOutGain gain = CompareByBlock({1, 2, 3, 4}, {0.5, 1.7, 2.3, 3.5});
  EXPECT_EQ(gain.blocks, 4);
  EXPECT_DOUBLE_EQ(gain.before_px, 2.5);
  EXPECT_DOUBLE_EQ(gain.after_px, 2.0);
  // Differences 0.5, 0.3, 0.7, 0.5.
  EXPECT_NEAR(gain.sigma_px, std::sqrt(0.08 / 12), 1e-12);
  EXPECT_TRUE(gain.IsClear(0.02, 2));
  EXPECT_FALSE(gain.IsClear(0.25, 2));
}

TEST(CompareByBlock, LeavesOutBlocksThatOneVariantDoesNotHave) {
  const HeldOutGain gain = CompareByBlock({1, INFINITY, 3}, {2, 1, INFINITY});
  EXPECT_EQ(gain.blocks, 1);
  EXPECT_DOUBLE_EQ(gain.before_px, 1);
  EXPECT_FALSE(gain.IsClear(0, 0));
}

// One block decides the sum: neither by the mean nor by the ranks.
TEST(CompareByBlock, OneLargeDifferenceIsNotClear) {
  const HeldOutGain gain =
      CompareByBlock({9, 1, 1, 1, 1, 1, 1, 1}, {2, 1.1, 0.9, 1.1, 0.9, 1.1, 1.1, 0.9});
  EXPECT_GT(gain.before_px, 1.5 * gain.after_px);
  EXPECT_FALSE(gain.IsClear(0.02, 2));
}

// All of them are smaller, though by very different numbers.
TEST(CompareByBlock, RanksSeeWhatHoldsInEveryBlock) {
  const HeldOutGain gain = CompareByBlock({9, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5},
                                          {2, 0.4, 0.3, 0.4, 0.35, 0.45, 0.4, 0.4});
  EXPECT_LT(gain.before_px - gain.after_px, 2 * gain.sigma_px);
  EXPECT_GT(gain.rank_sigmas, 2.5);
  EXPECT_TRUE(gain.IsClear(0.02, 2.5));
}

}  // namespace
}  // namespace rigcal::server::held_out_choice_test
