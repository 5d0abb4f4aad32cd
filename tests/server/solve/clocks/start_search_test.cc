// SPDX-License-Identifier: Apache-2.0
#include "server/solve/clocks/start_search.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cstdint>
#include <string>
#include <vector>

#include "tests/server/solve/clocks/synthetic_paths.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::start_search_test {
namespace {

using ::rigcal::testing::IsOk;
using ::testing::IsEmpty;
using ::testing::SizeIs;

// One track for each of these, each on a clock of its own; sessions by name.
RigObservations RigOfTracks(const std::vector<std::string>& sessions) {
  RigObservations rig;
  for (size_t t = 0; t < sessions.size(); ++t) {
    rig.tracks.emplace_back().track.session_id = sessions[t];
    rig.index.camera_of_track.push_back(static_cast<int>(t));
    rig.index.clock_of_track.push_back(static_cast<int>(t));
  }
  return rig;
}

std::vector<TrackPaths> Views(const std::vector<double>& offsets_s, double period_s = 0) {
  std::vector<TrackPaths> paths;
  for (const double offset_s : offsets_s) {
    paths.push_back(SyntheticPaths(
        {.view = static_cast<int>(paths.size()), .offset_s = offset_s, .period_s = period_s}));
  }
  return paths;
}

TEST(JoinByMotion, FindsEveryClock) {
  const std::vector<double> offsets_s = {0, 31.4, -7.77, 0.6, 12.25};
  ClockGroups groups(5);
  const auto ambiguous =
      JoinByMotion(RigOfTracks({"s", "s", "s", "s", "s"}), Views(offsets_s), {}, &groups);
  ASSERT_THAT(ambiguous, IsOk());
  EXPECT_THAT(*ambiguous, IsEmpty());
  for (int k = 1; k < 5; ++k) {
    ASSERT_TRUE(groups.Joined(0, k)) << k;
    EXPECT_NEAR(groups.Between(0, k), offsets_s[static_cast<size_t>(k)], 0.003) << k;
  }
}

// A point that moves by some pixels, with noise of a tenth of that: no pair of cameras says its
// offset clearly.
std::vector<TrackPaths> FarViews(const std::vector<double>& offsets_s, uint32_t seed) {
  std::vector<TrackPaths> paths;
  for (const double offset_s : offsets_s) {
    paths.push_back(SyntheticPaths({.view = static_cast<int>(paths.size()),
                                    .markers = 1,
                                    .duration_s = 80,
                                    .offset_s = offset_s,
                                    .noise_px = 0.4,
                                    .size = 0.02,
                                    .seed = seed}));
  }
  return paths;
}

TEST(JoinByMotion, CandidatesCountWhereTheyAgree) {
  const std::vector<double> offsets_s = {0, 31.4, -7.77, 0.6, 12.25};
  for (uint32_t seed = 1; seed < 6; ++seed) {
    const std::vector<TrackPaths> paths = FarViews(offsets_s, seed);
    ClockGroups two(2), five(5);
    ASSERT_THAT(JoinByMotion(RigOfTracks({"s", "s"}), paths, {}, &two), IsOk());
    EXPECT_FALSE(two.Joined(0, 1)) << seed;
    ASSERT_THAT(JoinByMotion(RigOfTracks({"s", "s", "s", "s", "s"}), paths, {}, &five), IsOk());
    for (int k = 1; k < 5; ++k) {
      EXPECT_TRUE(five.Joined(0, k)) << seed << " " << k;
      EXPECT_NEAR(five.Between(0, k), offsets_s[static_cast<size_t>(k)], 0.15) << seed << " " << k;
    }
  }
}

TEST(JoinByMotion, CandidatesOfDifferentMotionsDoNotAgree) {
  for (uint32_t seed = 1; seed < 40; seed += 5) {
    std::vector<TrackPaths> paths;
    for (uint32_t k = 0; k < 5; ++k) paths.push_back(FarViews({0, 0, 0, 0, 0}, seed + k)[k]);
    ClockGroups groups(5);
    ASSERT_THAT(JoinByMotion(RigOfTracks({"s", "s", "s", "s", "s"}), paths, {}, &groups), IsOk());
    for (int k = 1; k < 5; ++k) EXPECT_FALSE(groups.Joined(0, k)) << seed << " " << k;
  }
}

TEST(JoinByMotion, KeepsWhatIsKnown) {
  ClockGroups groups(3);
  groups.Join(0, 1, 0.125);  // as if: the motion says 0
  ASSERT_THAT(JoinByMotion(RigOfTracks({"s", "s", "s"}), Views({0, 0, 20}), {}, &groups), IsOk());
  EXPECT_EQ(groups.Between(0, 1), 0.125);
  ASSERT_TRUE(groups.Joined(0, 2));
}

TEST(JoinByMotion, LooksAtEachSessionByItself) {
  ClockGroups groups(4);
  ASSERT_THAT(
      JoinByMotion(RigOfTracks({"one", "two", "one", "two"}), Views({0, 5, 10, 15}), {}, &groups),
      IsOk());
  EXPECT_TRUE(groups.Joined(0, 2));
  EXPECT_TRUE(groups.Joined(1, 3));
  EXPECT_FALSE(groups.Joined(0, 1));
  EXPECT_NEAR(groups.Between(0, 2), 10, 0.003);
  EXPECT_NEAR(groups.Between(1, 3), 10, 0.003);
}

TEST(JoinByMotion, OfAPeriodicMotionNamesThePairAndJoinsNothing) {
  ClockGroups groups(2);
  const auto ambiguous = JoinByMotion(RigOfTracks({"s", "s"}), Views({0, 3.25}, 1.0), {}, &groups);
  ASSERT_THAT(ambiguous, IsOk());
  ASSERT_THAT(*ambiguous, SizeIs(1));
  EXPECT_EQ((*ambiguous)[0].track_a, 0);
  EXPECT_EQ((*ambiguous)[0].track_b, 1);
  EXPECT_GE((*ambiguous)[0].peaks.size(), 2u);
  EXPECT_FALSE(groups.Joined(0, 1));
}

TEST(JoinByMotion, StopsWhenCancelled) {
  const std::atomic<bool> cancelled = true;
  ClockGroups groups(2);
  const auto result =
      JoinByMotion(RigOfTracks({"s", "s"}), Views({0, 3}), {{}, &cancelled}, &groups);
  EXPECT_EQ(result.status().code(), absl::StatusCode::kCancelled);
}

}  // namespace
}  // namespace rigcal::server::start_search_test
