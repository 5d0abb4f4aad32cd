// SPDX-License-Identifier: Apache-2.0
#include "agent/event/event_gaps.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

namespace rigcal::agent::event_gaps_test {
namespace {

constexpr double kPeriodUs = 2000;
constexpr int64_t kLongestUs = 40'000;

// Events at these times, in batches.
EventGaps Watch(const std::vector<uint32_t>& times_us, size_t batch = 1000) {
  EventGaps gaps(kPeriodUs, kLongestUs);
  std::vector<PackedEvent> events;
  for (const uint32_t time_us : times_us) events.push_back({time_us, 1, 2});
  for (size_t begin = 0; begin < events.size(); begin += batch) {
    std::span<const PackedEvent> some(events);
    some = some.subspan(begin, std::min(batch, events.size() - begin));
    if (!gaps.MayHold(some)) {
      gaps.Pass(some);
      continue;
    }
    for (size_t next = gaps.Next(some); next < some.size(); next = gaps.Next(some)) {
      EXPECT_EQ(gaps.last().until_us, some[next].time_us);
      some = some.subspan(next + 1);
      if (some.empty()) break;
    }
  }
  return gaps;
}

std::vector<uint32_t> Noise(double mean_us, double seconds, uint32_t first_us = 0) {
  std::mt19937 random(1);
  std::vector<uint32_t> times_us;
  for (double at_us = 0; at_us < 1e6 * seconds;) {
    at_us -= mean_us *
             std::log(1 - 1e-9 - static_cast<double>(random() & 0xffffff) * 0x1p-24 * (1 - 2e-9));
    times_us.push_back(first_us + static_cast<uint32_t>(static_cast<int64_t>(at_us)));
  }
  return times_us;
}

void Cut(std::vector<uint32_t>* times_us, uint32_t from_us, uint32_t length_us) {
  std::erase_if(*times_us, [=](uint32_t time_us) { return time_us - from_us < length_us; });
}

TEST(EventGaps, NoiseAloneHasNone) {
  for (const double mean_us : {0.2, 1.0, 10.0, 100.0, 1000.0}) {
    EXPECT_EQ(Watch(Noise(mean_us, mean_us < 1 ? 0.5 : 5)).count(), 0u) << mean_us;
  }
}

TEST(EventGaps, LostMillisecondsAreCountedWithTheirLength) {
  for (const size_t batch : {size_t{7}, size_t{1000}}) {
    std::vector<uint32_t> times_us = Noise(1, 1);
    for (uint32_t at_us = 200'000; at_us < 900'000; at_us += 10'000) Cut(&times_us, at_us, 1000);
    const EventGaps gaps = Watch(times_us, batch);
    EXPECT_EQ(gaps.count(), 70u);
    EXPECT_NEAR(static_cast<double>(gaps.total_us()), 70'000, 500);
    EXPECT_TRUE(gaps.Overlap(890'500, 890'600));
    EXPECT_TRUE(gaps.Overlap(889'000, 890'100));
    EXPECT_FALSE(gaps.Overlap(891'100, 892'000));
  }
}

TEST(EventGaps, TimesMayWrap) {
  std::vector<uint32_t> times_us = Noise(1, 1, 0u - 500'000u);
  Cut(&times_us, 0u - 500u, 1000);
  const EventGaps gaps = Watch(times_us);
  EXPECT_EQ(gaps.count(), 1u);
  EXPECT_TRUE(gaps.Overlap(0u - 100u, 100u));
}

TEST(EventGaps, AStillSceneIsSilentBetweenBlinks) {
  std::vector<uint32_t> times_us;
  for (uint32_t half = 0; half < 1000; ++half) {
    for (uint32_t i = 0; i < 300; ++i) times_us.push_back(1000 * half + i / 2);
  }
  EXPECT_EQ(Watch(times_us).count(), 0u);
}

TEST(EventGaps, ADarkSceneIsNoGapButASilenceThatLastsIsOpen) {
  std::vector<uint32_t> times_us = Noise(1, 0.5);
  Cut(&times_us, 300'000, 100'000);
  EXPECT_EQ(Watch(times_us).count(), 0u);
  std::vector<uint32_t> before_us = Noise(1, 0.3);
  Cut(&before_us, 200'000, 1000);  // so that what is usual was asked for
  const EventGaps gaps = Watch(before_us);
  EXPECT_FALSE(gaps.IsOpenAt(gaps.silent_since_us() + 200));
  EXPECT_TRUE(gaps.IsOpenAt(gaps.silent_since_us() + 1000));
}

}  // namespace
}  // namespace rigcal::agent::event_gaps_test
