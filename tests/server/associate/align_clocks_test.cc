// SPDX-License-Identifier: Apache-2.0
#include "server/associate/align_clocks.h"

#include <gtest/gtest.h>

#include <limits>
#include <random>
#include <utility>
#include <vector>

#include "server/associate/instants.h"

namespace rigcal::server::align_clocks_test {
namespace {

CameraTrack Track(const std::string& camera, const std::string& timebase,
                  const std::vector<std::pair<int64_t, uint32_t>>& rows) {
  CameraTrack track;
  track.session_id = "s";
  track.camera.camera = camera;
  track.camera.clock = {camera + "-clock", timebase};
  for (const auto& [time_ns, epoch] : rows) {
    Observation observation;
    observation.time_ns = time_ns;
    observation.clock_epoch = epoch;
    track.observations.push_back(observation);
  }
  return track;
}

std::vector<AlignedTrack> Align(const std::vector<CameraTrack>& tracks, RefusalCounter* refused) {
  std::vector<CameraTrack> rows = tracks;
  return AlignClocks(tracks, CleanTracks(&rows, 1, refused), refused);
}

TEST(AlignClocks, KeepsEveryEpochOfACommonTimebase) {
  RefusalCounter refused;
  const auto aligned = Align({Track("a", "recording", {{10, 0}, {20, 0}, {30, 0}, {5, 1}, {15, 1}}),
                              Track("b", "recording", {{10, 0}})},
                             &refused);
  ASSERT_EQ(aligned.size(), 3u);
  EXPECT_EQ(aligned[1].track.clock_epoch, 1u);
  for (const AlignedTrack& track : aligned) EXPECT_EQ(track.clock_offset_ns, 0);
  EXPECT_TRUE(refused.empty());
}

TEST(AlignClocks, AlignsEveryEpochWithSamples) {
  CameraTrack track = Track("a", "", {{10, 0}, {20, 0}, {5, 1}, {7, 2}});
  const int64_t utc = 1'700'000'000'000'000'000;
  for (const int64_t wrong : {0, 3, -2, 0, 900'000'000}) {
    track.clock_samples.push_back({0, {100, 0, utc + 100 + wrong, 0}});
  }
  track.clock_samples.push_back({1, {100, 0, utc + 5000, 0}});
  track.host_alignments = {{0, 1'000'000, 900}, {0, 7, 10}};
  RefusalCounter refused;
  const auto aligned = Align({track}, &refused);
  ASSERT_EQ(aligned.size(), 2u);
  // The median of the samples, and the better of the two pings.
  EXPECT_EQ(aligned[0].clock_offset_ns, utc + 7);
  EXPECT_EQ(aligned[1].clock_offset_ns, utc + 4900 + 7);
  ASSERT_EQ(refused.List().size(), 1u);
  EXPECT_EQ(refused.List()[0].reason, RefusalReason::kClockEpochWithoutOffset);
  EXPECT_EQ(refused.List()[0].count, 1u);
}

// The host's UTC is set an hour ahead, and most samples come after that, most pings before.
TEST(AlignClocks, AWallClockThatIsSetMovesNothing) {
  constexpr int64_t kSecond = 1'000'000'000;
  constexpr int64_t kHour = 3600 * kSecond;
  constexpr int64_t kUtc = 1'700'000'000 * kSecond;
  for (const int64_t step : {kHour, -kHour, int64_t{200'000'000}}) {
    CameraTrack track = Track("a", "", {{10, 0}, {20, 0}});
    for (int64_t second = 100; second < 110; ++second) {
      const int64_t utc_ns = kUtc + second * kSecond + (second < 103 ? 0 : step);
      track.clock_samples.push_back({0, {second * kSecond + 42, second * kSecond, utc_ns, 0}});
    }
    // One between the samples around the step, and one before all samples.
    for (const int64_t ping_ms : {90'000, 100'500, 101'500, 102'500, 108'500}) {
      const bool is_set = ping_ms > 102'100;
      track.host_alignments.push_back({ping_ms * 1'000'000, 7 - (is_set ? step : 0), 100});
    }
    RefusalCounter refused;
    const auto aligned = Align({track}, &refused);
    ASSERT_EQ(aligned.size(), 1u);
    EXPECT_EQ(aligned[0].clock_offset_ns, kUtc - 42 + 7) << step;
    EXPECT_LT(aligned[0].offset_sigma_s, 0.01);
  }
}

TEST(AlignClocks, CamerasOnOneClockShareItsSamples) {
  CameraTrack a = Track("a", "", {{10, 0}}), b = Track("b", "", {{10, 0}});
  b.camera.clock.clock_id = a.camera.clock.clock_id;
  a.clock_samples.push_back({0, {0, 0, 1000, 0}});
  RefusalCounter refused;
  const auto aligned = Align({a, b}, &refused);
  ASSERT_EQ(aligned.size(), 2u);
  EXPECT_EQ(aligned[1].clock_offset_ns, 1000);
}

TEST(AlignClocks, LatencyMakesRowsEarlier) {
  CameraTrack track = Track("a", "ptp", {{1'000'000, 0}});
  track.camera.latency_s = 0.0004;
  RefusalCounter refused;
  const auto aligned = Align({track}, &refused);
  EXPECT_EQ(aligned[0].CoarseRigTimeNs(aligned[0].track.observations.time_ns(0)), 600'000);
}

TEST(AlignClocks, PeriodIsTheMedianStep) {
  RefusalCounter refused;
  const auto aligned = Align({Track("a", "ptp", {{0, 0}, {10, 0}, {20, 0}, {500, 0}})}, &refused);
  EXPECT_DOUBLE_EQ(aligned[0].period_s, 10e-9);
}

// With -fsanitize=undefined an overflow ends the test.
TEST(AlignClocks, FramesHaveAPeriodWhereMostRowsAreLost) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(0, 1);
  std::vector<std::pair<int64_t, uint32_t>> rows;
  for (int64_t frame = 0; frame < 600; ++frame) {
    const int64_t jitter_ns = static_cast<int64_t>(1e5 * uniform(random));
    if (uniform(random) < 0.3) rows.push_back({100'000'000 * frame + jitter_ns, 0});
  }
  RefusalCounter refused;
  const auto aligned = Align({Track("a", "ptp", rows)}, &refused);
  EXPECT_GT(aligned[0].period_s, 0.15);
  EXPECT_NEAR(aligned[0].FramePeriodS(), 0.1, 1e-3);
}

// Alternately 4 and 6 ms: both are multiples of 2 ms, at which nothing ever comes.
TEST(AlignClocks, UnevenStepsHaveNoPeriodBelowTheirOwn) {
  std::vector<std::pair<int64_t, uint32_t>> rows;
  for (int64_t i = 0; i < 200; ++i) rows.push_back({10'000'000 * (i / 2) + 4'000'000 * (i % 2), 0});
  RefusalCounter refused;
  const auto aligned = Align({Track("a", "ptp", rows)}, &refused);
  EXPECT_EQ(aligned[0].FramePeriodS(), aligned[0].period_s);
}

TEST(AlignClocks, ClocksThatSayTheExtremeDoNotOverflow) {
  constexpr int64_t kMin = std::numeric_limits<int64_t>::min();
  constexpr int64_t kMax = std::numeric_limits<int64_t>::max();
  constexpr int64_t kTime = int64_t{1} << 62;  // the most that ingest lets through
  for (const int64_t device_ns : {int64_t{0}, kMin, kMax}) {
    for (const int64_t utc_ns : {int64_t{0}, kMin, kMax}) {
      for (const int64_t correction_ns : {int64_t{0}, kMin, kMax}) {
        CameraTrack a = Track("a", "", {{0, 0}, {kTime, 0}}), b = Track("b", "", {{5, 0}, {6, 0}});
        a.clock_samples = {{0, {device_ns, 0, utc_ns, 0}}, {0, {utc_ns, 0, device_ns, 0}}};
        b.clock_samples = {{0, {5, 0, 5, 0}}};
        a.host_alignments = {{0, correction_ns, 1}};
        RefusalCounter refused;
        const auto aligned = Align({a, b}, &refused);
        const auto times = CoarseRigTimes(aligned);
        const InstantList list = FindInstants(aligned, times, 0);
        EXPECT_LE(list.instants.size(), 2u);
      }
    }
  }
}

TEST(AlignClocks, AnEpochFarFromAllOthersIsRefusedWithItsReason) {
  constexpr int64_t kTime = int64_t{1} << 62;
  CameraTrack a = Track("a", "", {{kTime - 10, 0}, {kTime, 0}});
  a.clock_samples = {{0, {0, 0, kTime, 0}}};
  RefusalCounter refused;
  EXPECT_TRUE(Align({a}, &refused).empty());
  ASSERT_EQ(refused.List().size(), 1u);
  EXPECT_EQ(refused.List()[0].reason, RefusalReason::kClockEpochWithoutOffset);
  EXPECT_EQ(refused.List()[0].count, 2u);
  EXPECT_NE(refused.List()[0].example.find("146 years"), std::string::npos);
}

}  // namespace
}  // namespace rigcal::server::align_clocks_test
