// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/device_clock.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace rigcal::agent::device_clock_test {
namespace {

constexpr int64_t kMs = 1'000'000;
constexpr int64_t kSecond = 1000 * kMs;
constexpr int64_t kHost = 500 * kSecond;           // monotonic, when the device's clock shows 0
constexpr int64_t kUtc = 1'700'000'000 * kSecond;  // then

// The frame that the device stamped then and that took this long to come.
ClockSample ArrivalAt(int64_t device_ns, int64_t delay_ns = 2 * kMs, int64_t host_ns = kHost) {
  return {device_ns, host_ns + device_ns + delay_ns, kUtc + device_ns + delay_ns};
}

ClockSample ReadingAt(int64_t device_ns) {
  return {device_ns, kHost + device_ns, kUtc + device_ns, 1000};
}

TEST(DeviceClock, StaysInItsEpochWhileTimeGoesOn) {
  DeviceClock clock;
  EXPECT_EQ(clock.EpochOf(5 * kSecond, ArrivalAt(5 * kSecond)), 0u);
  EXPECT_EQ(clock.EpochOf(5 * kSecond, ArrivalAt(5 * kSecond)), 0u);
  EXPECT_EQ(clock.EpochOf(500 * kSecond, ArrivalAt(500 * kSecond)), 0u);
}

TEST(DeviceClock, AStepBackwardsOpensAnEpoch) {
  DeviceClock clock;
  clock.EpochOf(5 * kSecond, ArrivalAt(5 * kSecond));
  EXPECT_EQ(clock.EpochOf(5 * kSecond - 1, ArrivalAt(5 * kSecond - 1)), 1u);
  EXPECT_EQ(clock.EpochOf(6 * kSecond, ArrivalAt(6 * kSecond)), 1u);
}

TEST(DeviceClock, AClockThatRanOnWhileAwayIsTheSame) {
  DeviceClock clock;
  clock.EpochOf(5 * kSecond, ArrivalAt(5 * kSecond));
  clock.Reconnected();
  EXPECT_EQ(clock.EpochOf(60 * kSecond, ArrivalAt(60 * kSecond, 300 * kMs)), 0u);
}

TEST(DeviceClock, AClockThatBeganAnewWhileAwayIsAnotherEvenAhead) {
  DeviceClock clock;
  clock.EpochOf(5 * kSecond, ArrivalAt(5 * kSecond));
  clock.Reconnected();
  // Powered up again 20 s before this frame.
  EXPECT_EQ(clock.EpochOf(20 * kSecond, ArrivalAt(20 * kSecond, 0, kHost + 100 * kSecond)), 1u);
  EXPECT_EQ(clock.EpochOf(21 * kSecond, ArrivalAt(21 * kSecond, 0, kHost + 100 * kSecond)), 1u);
}

TEST(DeviceClock, AJumpOfArrivalAloneIsNoNewClock) {
  DeviceClock clock;
  clock.EpochOf(5 * kSecond, ArrivalAt(5 * kSecond));
  EXPECT_EQ(clock.EpochOf(6 * kSecond, ArrivalAt(6 * kSecond, 3 * kSecond)), 0u);
}

TEST(DeviceClock, ReadingsAreDueOnceASecond) {
  DeviceClock clock;
  EXPECT_TRUE(clock.ReadingIsDue(kHost));
  ASSERT_TRUE(clock.AddReading(ReadingAt(0)));
  EXPECT_FALSE(clock.ReadingIsDue(kHost + kSecond - 1));
  EXPECT_TRUE(clock.ReadingIsDue(kHost + kSecond));
  EXPECT_THAT(clock.Take(), ::testing::ElementsAre(ReadingAt(0)));
  EXPECT_TRUE(clock.Take().empty());
}

TEST(DeviceClock, RefusesReadingsOfAnotherClock) {
  DeviceClock clock;
  clock.EpochOf(5 * kSecond, ArrivalAt(5 * kSecond));
  EXPECT_TRUE(clock.AddReading(ReadingAt(5 * kSecond)));
  ClockSample ticks = ReadingAt(6 * kSecond);
  ticks.device_ns /= 8;
  EXPECT_FALSE(clock.AddReading(ticks));
  EXPECT_EQ(clock.Take().size(), 1u);
}

TEST(DeviceClock, ReadingsOfTheEpochBeforeAreDropped) {
  DeviceClock clock;
  clock.EpochOf(5 * kSecond, ArrivalAt(5 * kSecond));
  clock.AddReading(ReadingAt(5 * kSecond));
  clock.EpochOf(kSecond, ArrivalAt(kSecond));
  EXPECT_TRUE(clock.Take().empty());
  EXPECT_TRUE(clock.ReadingIsDue(kHost + 5 * kSecond));
}

TEST(DeviceClock, TakesTheFrameThatCameQuickestOfEachSecond) {
  DeviceClock clock;
  // The first at once, so that a short capture has one too.
  clock.AddArrival(ArrivalAt(0, 9 * kMs));
  EXPECT_EQ(clock.Take().size(), 1u);
  for (int i = 1; i <= 100; ++i) {
    clock.AddArrival(ArrivalAt(i * 20 * kMs, (i == 33 ? 1 : 4 + i % 5) * kMs));
  }
  const std::vector<ClockSample> samples = clock.Take();
  ASSERT_EQ(samples.size(), 1u);
  EXPECT_EQ(samples[0].device_ns, 33 * 20 * kMs);
  EXPECT_EQ(samples[0].host_monotonic_ns - kHost - samples[0].device_ns, kMs);
  EXPECT_EQ(samples[0].host_utc_ns - kUtc - samples[0].device_ns, kMs);
  EXPECT_EQ(samples[0].uncertainty_ns, DeviceClock::kArrivalUncertaintyNs);
}

TEST(DeviceClock, IsBoundedWhenNobodyTakes) {
  DeviceClock clock;
  for (int i = 0; i < 5000; ++i) clock.AddReading(ReadingAt(i * kSecond));
  const std::vector<ClockSample> samples = clock.Take();
  EXPECT_LE(samples.size(), 1000u);
  EXPECT_EQ(samples.back().device_ns, 4999 * kSecond);
}

}  // namespace
}  // namespace rigcal::agent::device_clock_test
