// SPDX-License-Identifier: Apache-2.0
#include "server/live/live_limits.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

namespace rigcal::testing::live_limits_test {
namespace {

using server::LiveEstimate;
using server::LiveVolume;
using ::testing::IsEmpty;
using ::testing::SizeIs;

TEST(LiveLimits, CutNoCharacterInTwo) {
  std::string text(511, 'a');
  text += "\u00b5m";  // two octets, of which one would fit
  server::LimitAlertText(&text);
  EXPECT_EQ(text, std::string(511, 'a'));
  text += "m";
  server::LimitAlertText(&text);
  EXPECT_THAT(text, SizeIs(512));
}

TEST(LiveLimits, KeepTheNewestOfTheHistory) {
  LiveEstimate estimate;
  for (int i = 0; i < 1000; ++i) estimate.history.push_back({.time_s = static_cast<double>(i)});
  server::LimitEstimate(&estimate);
  ASSERT_THAT(estimate.history, SizeIs(300));
  EXPECT_EQ(estimate.history.front().time_s, 700);
  EXPECT_EQ(estimate.history.back().time_s, 999);
}

LiveEstimate WithGrid(uint32_t count_x, uint32_t count_y, uint32_t count_z, size_t values) {
  LiveEstimate estimate;
  LiveVolume& volume = estimate.volume.emplace();
  volume.count_x = count_x;
  volume.count_y = count_y;
  volume.count_z = count_z;
  volume.p95_mm = 0.7;
  volume.sigma_mm.resize(values);
  volume.wand_counts.resize(values);
  server::LimitEstimate(&estimate);
  return estimate;
}

TEST(LiveLimits, LeaveAGridOutThatIsTooLargeOrHasNotItsValues) {
  EXPECT_THAT(WithGrid(16, 16, 16, 4096).volume->sigma_mm, SizeIs(4096));
  // The product of the counts is a multiple of 2^32.
  for (const LiveEstimate& estimate :
       {WithGrid(17, 16, 16, 4352), WithGrid(2, 2, 2, 7), WithGrid(65536, 65536, 1, 0)}) {
    EXPECT_EQ(estimate.volume->count_x, 0u);
    EXPECT_THAT(estimate.volume->sigma_mm, IsEmpty());
    EXPECT_THAT(estimate.volume->wand_counts, IsEmpty());
    EXPECT_EQ(estimate.volume->p95_mm, 0.7);
  }
}

}  // namespace
}  // namespace rigcal::testing::live_limits_test
