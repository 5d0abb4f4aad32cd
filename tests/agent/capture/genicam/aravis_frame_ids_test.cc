// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/genicam/aravis_frame_ids.h"

#include <gtest/gtest.h>

#include <numeric>
#include <vector>

namespace rigcal::agent::aravis_frame_ids_test {
namespace {

uint64_t LostOf(const std::vector<uint64_t>& ids) {
  FrameIdTracker tracker;
  uint64_t lost = 0;
  for (const uint64_t id : ids) lost += tracker.Arrived(id);
  return lost;
}

TEST(FrameIdTracker, NothingIsLostInAnUnbrokenRow) {
  EXPECT_EQ(LostOf({}), 0u);
  EXPECT_EQ(LostOf({17}), 0u);
  EXPECT_EQ(LostOf({1, 2, 3, 4}), 0u);
  EXPECT_EQ(LostOf({0, 1, 2}), 0u);  // USB3 Vision
}

TEST(FrameIdTracker, CountsGaps) {
  EXPECT_EQ(LostOf({1, 3}), 1u);
  EXPECT_EQ(LostOf({1, 3, 4, 104}), 100u);
}

TEST(FrameIdTracker, SixteenBitsGoOnWithOne) {
  EXPECT_EQ(LostOf({65534, 65535, 1, 2}), 0u);
  EXPECT_EQ(LostOf({65534, 1}), 1u);     // 65535
  EXPECT_EQ(LostOf({65534, 3}), 3u);     // 65535, 1, 2
  EXPECT_EQ(LostOf({65535, 0, 1}), 0u);  // a camera that counts the 0
}

TEST(FrameIdTracker, WholeCirclesOfSixteenBitsAreFollowed) {
  FrameIdTracker tracker;
  uint64_t lost = 0;
  uint64_t missing = 0;
  for (uint64_t i = 0; i < 200'000; ++i) {
    if (i % 97 == 50) {
      ++missing;
      continue;
    }
    lost += tracker.Arrived(i % 65'535 + 1);
  }
  EXPECT_EQ(lost, missing);
}

TEST(FrameIdTracker, SixtyFourBitsDoNotWrap) {
  EXPECT_EQ(LostOf({65534, 65535, 65536, 65537}), 0u);
  EXPECT_EQ(LostOf({65535, 65536, 65540}), 3u);
  EXPECT_EQ(LostOf({1'000'000, 1'040'000}), 39'999u);
}

TEST(FrameIdTracker, LateAndRepeatedNumbersLoseNothing) {
  EXPECT_EQ(LostOf({10, 11, 11, 12}), 0u);
  EXPECT_EQ(LostOf({10, 12, 11, 13}), 1u);
  EXPECT_EQ(LostOf({70'000, 70'002, 70'001, 70'003}), 1u);
  EXPECT_EQ(LostOf({2, 65'530, 3}), 0u);  // from before the wrap
}

TEST(FrameIdTracker, ACountThatBeginsAnewLosesNothing) {
  EXPECT_EQ(LostOf({500, 501, 1, 2, 4}), 1u);
  EXPECT_EQ(LostOf({100'500, 100'501, 0, 1, 3}), 1u);
}

TEST(FrameIdTracker, ANumberFromNowhereIsNoGap) {
  EXPECT_EQ(LostOf({70'000, UINT64_MAX, 70'001}), 0u);
}

TEST(FrameIdTracker, AFrameWithoutNumberTakesTheNext) {
  FrameIdTracker tracker;
  tracker.ArrivedWithoutId();  // before any: tells nothing
  tracker.Arrived(65'534);
  tracker.ArrivedWithoutId();
  tracker.ArrivedWithoutId();
  EXPECT_EQ(tracker.Arrived(2), 0u);
  tracker.ArrivedWithoutId();
  EXPECT_EQ(tracker.Arrived(5), 1u);
}

TEST(FrameIdTracker, RestartForgets) {
  FrameIdTracker tracker;
  tracker.Arrived(100'000);
  tracker.Restart();
  EXPECT_EQ(tracker.Arrived(65'535), 0u);
  EXPECT_EQ(tracker.Arrived(1), 0u);
}

}  // namespace
}  // namespace rigcal::agent::aravis_frame_ids_test
