// SPDX-License-Identifier: Apache-2.0
#include "server/solve/diagnose/session_timeline.h"

#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

namespace rigcal::server::session_timeline_test {
namespace {

constexpr int64_t kSecondNs = 1'000'000'000;

// Instants by session and time; each session has one clock.
struct Recording {
  TrialProblem trial;
  std::vector<ClockCorrection> clocks;

  explicit Recording(const std::vector<std::pair<std::string, std::vector<int64_t>>>& sessions) {
    for (const auto& [name, seconds] : sessions) {
      const auto clock = static_cast<int>(clocks.size());
      clocks.emplace_back().session_id = name;
      for (const int64_t second : seconds) {
        BundleInstant instant;
        instant.first_observation = static_cast<int>(trial.problem.observations.size());
        instant.observation_count = 1;
        trial.problem.instants.push_back(instant);
        trial.problem.observations.emplace_back().clock = clock;
        trial.instant_time_ns.push_back(second * kSecondNs);
      }
    }
  }
};

TEST(SessionTimelineTest, OneSessionBeginsAtItsFirstInstant) {
  const Recording one({{"a", {100, 103, 110}}});
  const SessionTimeline timeline(one.trial, one.clocks);
  EXPECT_EQ(timeline.TimeNs(0), 0);
  EXPECT_EQ(timeline.TimeNs(2), 10 * kSecondNs);
  EXPECT_TRUE(timeline.BeginsNs().empty());
  EXPECT_EQ(timeline.Describe(3 * kSecondNs), "3.0 s after the first wand view");
}

TEST(SessionTimelineTest, SessionsFollowEachOtherByTime) {
  const Recording two({{"a", {1000, 1005}}, {"b", {100, 102}}});
  const SessionTimeline timeline(two.trial, two.clocks);
  // b, a second between them, a.
  EXPECT_EQ(timeline.TimeNs(2), 0);
  EXPECT_EQ(timeline.TimeNs(3), 2 * kSecondNs);
  EXPECT_EQ(timeline.BeginsNs(), std::vector<int64_t>{3 * kSecondNs});
  EXPECT_EQ(timeline.TimeNs(0), 3 * kSecondNs);
  EXPECT_EQ(timeline.Describe(7 * kSecondNs),
            "4.0 s after the first wand view of session a");
}

TEST(SessionTimelineTest, SessionsWhoseClocksOverlapFollowByName) {
  // Clocks that were started anew: both show the same times.
  const Recording two({{"b", {10, 14}}, {"a", {11, 12}}});
  const SessionTimeline timeline(two.trial, two.clocks);
  EXPECT_EQ(timeline.TimeNs(2), 0);
  EXPECT_EQ(timeline.TimeNs(0), 2 * kSecondNs);
}

TEST(SessionTimelineTest, AChangeNearABeginIsOneBetweenSessions) {
  const Recording two({{"a", {0, 10}}, {"b", {100, 120}}});
  const SessionTimeline timeline(two.trial, two.clocks);
  const int64_t begin_ns = 11 * kSecondNs;
  EXPECT_EQ(timeline.Snapped(begin_ns + kSecondNs / 2), begin_ns);
  EXPECT_EQ(timeline.Snapped(begin_ns - kSecondNs / 2), begin_ns);
  EXPECT_EQ(timeline.Snapped(begin_ns + 2 * kSecondNs), begin_ns + 2 * kSecondNs);
  EXPECT_EQ(timeline.Describe(begin_ns), "between session a and session b,");
}

}  // namespace
}  // namespace rigcal::server::session_timeline_test
