// SPDX-License-Identifier: Apache-2.0
#include "client/results/trajectory_clock.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "client/results/trajectory_evaluation.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::client::trajectory_clock_test {
namespace {

using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

Eigen::Vector3d WavedAt(double t) {
  return {std::sin(1.3 * t) + 0.2 * std::sin(4 * t), std::cos(1.7 * t),
          0.5 * std::sin(2.3 * t + 1)};
}

// With a millimetre of noise; its clock shows `ahead_s` + `rate` times the time.
Trajectories Waved(double hz, double from_s, double to_s, double rate, double ahead_s,
                   unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0, 0.001);
  Trajectories all;
  for (double t = from_s; t < to_s; t += 1 / hz) {
    all["a"].push_back({rate * t + ahead_s,
                        WavedAt(t) + Eigen::Vector3d(noise(random), noise(random), noise(random))});
  }
  return all;
}

TEST(EvaluateTrajectoriesClock, NamesAClockThatRunsAtAnotherRate) {
  const Trajectories estimate = Waved(50, 0, 60, 1, 0, 1);
  for (const double rate : {1.01, 0.99, 1.001}) {
    for (const auto& [hz, from_s, to_s] : {std::tuple(100., 0., 60.), {20., 3., 50.}}) {
      const Trajectories truth = Waved(hz, from_s, to_s, rate, 0.3, 2);
      const auto result = EvaluateTrajectories(estimate, truth, {});
      // Said beside the numbers, or instead of them where nothing fits.
      const std::string said = result.ok() ? (result->notes.empty() ? "" : result->notes.front())
                                           : std::string(result.status().message());
      const auto found = FindClockRate(estimate, truth, 0.3, 0.1, false);
      ASSERT_TRUE(found.has_value()) << rate << " at " << hz << " Hz";
      EXPECT_NEAR(*found, 1 / rate, 2e-5) << rate << " at " << hz << " Hz";
      EXPECT_THAT(said, AllOf(HasSubstr(rate > 1 ? "too fast" : "too slow"),
                              HasSubstr("with its times times")))
          << rate << " at " << hz << " Hz";
    }
  }
}

TEST(EvaluateTrajectoriesClock, NamesARateThatAMirroredAxisHides) {
  Trajectories truth = Waved(100, 0, 60, 1.01, 0.3, 2);
  for (TrajectoryPoint& point : truth["a"]) point.position_m.x() *= -1;
  EXPECT_THAT(EvaluateTrajectories(Waved(50, 0, 60, 1, 0, 1), truth, {}),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("too fast"), HasSubstr("mirrored"))));
}

TEST(EvaluateTrajectoriesClock, SaysNothingOfAGoodClock) {
  ASSERT_OK_AND_ASSIGN(
      const TrajectoryEvaluation result,
      EvaluateTrajectories(Waved(50, 0, 60, 1, 0, 1), Waved(100, 0, 60, 1, 0.3, 2), {}));
  EXPECT_THAT(result.notes, IsEmpty());
}

TEST(EvaluateTrajectoriesClock, NamesTimesInMilliseconds) {
  const Trajectories seconds = Waved(50, 0, 60, 1, 0, 1);
  for (const double hz : {10., 50., 200.}) {
    const Trajectories milliseconds = WithClock(Waved(hz, 5, 55, 1, 0.3, 2), 1000, 0);
    EXPECT_THAT(EvaluateTrajectories(seconds, milliseconds, {}),
                StatusIs(absl::StatusCode::kInvalidArgument,
                         AllOf(HasSubstr("ground truth times 0.001"), HasSubstr("time_ms"))))
        << hz;
    EXPECT_THAT(EvaluateTrajectories(milliseconds, seconds, {}),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("estimate times 0.001")))
        << hz;
  }
  const Trajectories nanoseconds = WithClock(Waved(100, 5, 55, 1, 0.3, 2), 1e9, 0);
  EXPECT_THAT(EvaluateTrajectories(seconds, nanoseconds, {}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("time_ns")));
}

TEST(EvaluateTrajectoriesClock, AsksWhereBothAreInMilliseconds) {
  const Trajectories estimate = WithClock(Waved(50, 0, 60, 1, 0, 1), 1000, 0);
  const Trajectories truth = WithClock(Waved(50, 0, 60, 1, 0, 2), 1000, 0);
  ASSERT_OK_AND_ASSIGN(const TrajectoryEvaluation result,
                       EvaluateTrajectories(estimate, truth, {.longest_offset_s = 2}));
  EXPECT_THAT(result.notes, Contains(HasSubstr("are its times in milliseconds?")));
}

// What is sampled a hundred times as often is no other unit.
TEST(EvaluateTrajectoriesClock, TakesRatesThatDifferMuch) {
  ASSERT_OK_AND_ASSIGN(
      const TrajectoryEvaluation result,
      EvaluateTrajectories(Waved(1000, 0, 20, 1, 0, 1), Waved(10, 0, 20, 1, 0, 2), {}));
  EXPECT_NEAR(result.time_offset_s, 0, 2e-3);
}

}  // namespace
}  // namespace rigcal::client::trajectory_clock_test
