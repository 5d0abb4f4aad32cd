// SPDX-License-Identifier: Apache-2.0
#include "server/live/overlap_counter.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <random>
#include <tuple>
#include <vector>

namespace rigcal::testing::overlap_counter_test {
namespace {

constexpr int64_t kMs = 1'000'000;

// Rows of a camera at this rate and phase, from `begin_ms` to `end_ms`.
void See(server::OverlapCounter* counter, size_t camera, double rate_hz, int64_t phase_ms,
         int64_t begin_ms, int64_t end_ms) {
  const auto period_ns = static_cast<int64_t>(1e9 / rate_hz);
  for (int64_t t = begin_ms * kMs + phase_ms * kMs; t < end_ms * kMs; t += period_ns) {
    counter->Add(camera, t - period_ns / 2, t + period_ns / 2);
  }
}

TEST(OverlapCounter, CountsTimeInCommonWhateverTheTrigger) {
  server::OverlapCounter counter(3);
  See(&counter, 0, 50, 0, 0, 10'000);
  See(&counter, 1, 25, 13, 0, 10'000);
  See(&counter, 2, 50, 7, 4'000, 6'000);
  EXPECT_NEAR(counter.PairS(0, 1), 10, 0.1);
  EXPECT_NEAR(counter.PairS(0, 2), 2, 0.1);
  EXPECT_NEAR(counter.PairS(2, 1), 2, 0.1);
  EXPECT_NEAR(counter.SharedS(0), 10, 0.1);
  EXPECT_NEAR(counter.SharedS(2), 2, 0.1);
}

TEST(OverlapCounter, TimesThatDoNotMeetCountNothing) {
  server::OverlapCounter counter(2);
  See(&counter, 0, 50, 0, 0, 2'000);
  See(&counter, 1, 50, 0, 3'000, 5'000);
  EXPECT_EQ(counter.PairS(0, 1), 0);
  EXPECT_EQ(counter.SharedS(0), 0);
}

TEST(OverlapCounter, TheOrderOfArrivalMakesNoDifference) {
  std::vector<std::tuple<size_t, int64_t>> rows;
  for (size_t camera = 0; camera < 4; ++camera) {
    for (int64_t i = 0; i < 500; ++i) rows.emplace_back(camera, (i * 20 + 3) * kMs);
  }
  std::mt19937 random(1);
  std::vector<double> first;
  for (int round = 0; round < 3; ++round) {
    server::OverlapCounter counter(4);
    for (const auto& [camera, time_ns] : rows) {
      counter.Add(camera, time_ns - 10 * kMs, time_ns + 10 * kMs);
      // Repetition changes nothing.
      counter.Add(camera, time_ns - 10 * kMs, time_ns + 10 * kMs);
    }
    std::vector<double> counts;
    for (size_t a = 0; a < 4; ++a) {
      counts.push_back(counter.SharedS(a));
      for (size_t b = a + 1; b < 4; ++b) counts.push_back(counter.PairS(a, b));
    }
    if (round == 0) first = counts;
    EXPECT_EQ(counts, first);
    EXPECT_NEAR(counts[0], 10, 0.1);
    std::ranges::shuffle(rows, random);
  }
}

TEST(OverlapCounter, AddsWhatAnotherOneHasCounted) {
  // A long time, one camera after the other.
  server::OverlapCounter earlier(3, 20'000);
  See(&earlier, 0, 50, 0, 0, 300'000);
  See(&earlier, 1, 50, 0, 100'000, 300'000);
  server::OverlapCounter counter(3);
  See(&counter, 0, 50, 0, 0, 2'000);
  See(&counter, 2, 50, 0, 0, 2'000);
  counter.Add(earlier);
  EXPECT_NEAR(counter.PairS(0, 1), 200, 0.1);
  EXPECT_NEAR(counter.PairS(0, 2), 2, 0.1);
  EXPECT_NEAR(counter.SharedS(0), 202, 0.1);
  EXPECT_EQ(counter.PairS(1, 2), 0);
  counter.Add(server::OverlapCounter(2));  // of other cameras
  EXPECT_NEAR(counter.SharedS(0), 202, 0.1);
}

TEST(OverlapCounter, BearsAnyTimeAndManyCameras) {
  server::OverlapCounter none(0);
  none.Add(0, 0, 20 * kMs);
  server::OverlapCounter counter(1000);
  EXPECT_EQ(counter.camera_count(), server::OverlapCounter::kMaxCameras);
  counter.Add(999, 0, 20 * kMs);
  counter.Add(0, std::numeric_limits<int64_t>::min(), std::numeric_limits<int64_t>::max());
  counter.Add(0, -40 * kMs, -20 * kMs);
  counter.Add(511, -40 * kMs, -20 * kMs);
  EXPECT_NEAR(counter.PairS(0, 511), 0.02, 1e-9);
}

}  // namespace
}  // namespace rigcal::testing::overlap_counter_test
