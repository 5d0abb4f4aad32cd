// SPDX-License-Identifier: Apache-2.0
#include "server/solve/diagnose/clock_course_model.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <random>
#include <vector>

namespace rigcal::server {
namespace {

using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr double kSigmaS = 2e-4, kLengthS = 60;

// Twenty blocks of a minute, with noise.
ClockCourse Choose(const std::function<double(double)>& offset_s, uint32_t seed = 1,
                   size_t count = 20, double noise_s = kSigmaS) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0, noise_s);
  std::vector<CourseBlock> blocks;
  for (size_t b = 0; b < count; ++b) {
    const double time_s = (static_cast<double>(b) + 0.5) * kLengthS / static_cast<double>(count);
    blocks.push_back({time_s, offset_s(time_s) + noise(random), kSigmaS, 0.3});
  }
  ClockCourse course;
  ChooseCourseModel(blocks, &course);
  return course;
}

// Largest difference from the truth, where no step is near.
double WorstS(const ClockCourse& course, const std::function<double(double)>& offset_s) {
  double worst_s = 0;
  for (double time_s = 2; time_s < kLengthS - 2; time_s += 0.5) {
    bool near_step = false;
    for (const ClockStep& step : course.steps) {
      near_step = near_step || std::abs(time_s - step.time_s) < 3;
    }
    if (near_step) continue;
    worst_s = std::max(worst_s, std::abs(course.OffsetAt(time_s) - offset_s(time_s)));
  }
  return worst_s;
}

TEST(ClockCourseModel, NoiseIsNoCourse) {
  const auto truth = [](double) { return 0.001; };
  for (uint32_t seed = 0; seed < 200; ++seed) {
    for (const size_t count : {6U, 12U, 20U}) {
      EXPECT_EQ(Choose(truth, seed, count).kind, CourseKind::kConstant) << seed << " " << count;
    }
    // Three times as much as the blocks' sigmas say.
    EXPECT_EQ(Choose(truth, seed, 20, 3 * kSigmaS).kind, CourseKind::kConstant) << seed;
  }
}

TEST(ClockCourseModel, OneStepIsNoMore) {
  const auto truth = [](double time_s) { return time_s < 21 ? 0.0 : -0.03; };
  for (uint32_t seed = 0; seed < 100; ++seed) {
    const ClockCourse course = Choose(truth, seed);
    ASSERT_EQ(course.kind, CourseKind::kSteps) << seed;
    ASSERT_THAT(course.steps, SizeIs(1)) << seed;
    EXPECT_NEAR(course.steps[0].size_s, -0.03, 5 * course.steps[0].sigma_s);
    EXPECT_NEAR(course.steps[0].time_s, 21, 3);
    EXPECT_EQ(course.size_s, course.steps[0].size_s);
  }
}

TEST(ClockCourseModel, SeveralStepsOnALineAreFound) {
  const auto truth = [](double time_s) {
    return -3e-4 * time_s + (time_s < 20 ? 0 : 0.02) + (time_s < 41 ? 0 : 0.025);
  };
  for (uint32_t seed = 0; seed < 50; ++seed) {
    const ClockCourse course = Choose(truth, seed);
    ASSERT_THAT(course.steps, SizeIs(2)) << seed;
    EXPECT_NEAR(course.size_s, 0.025, 2e-3);
    EXPECT_LT(WorstS(course, truth), 1e-3) << seed;
  }
  const auto back_and_forth = [](double time_s) {
    return (time_s < 12 ? 0 : 0.02) - (time_s < 30 ? 0 : 0.03) + (time_s < 48 ? 0 : 0.04);
  };
  const ClockCourse course = Choose(back_and_forth);
  ASSERT_THAT(course.steps, SizeIs(3));
  EXPECT_LT(WorstS(course, back_and_forth), 1e-3);
  EXPECT_NEAR(course.size_s, 0.04, 2e-3);
}

TEST(ClockCourseModel, StepsThatTogetherAreNoneAreFound) {
  const auto truth = [](double time_s) { return time_s < 24 || time_s >= 39 ? 0.0 : 0.03; };
  const ClockCourse course = Choose(truth);
  ASSERT_THAT(course.steps, SizeIs(2));
  EXPECT_NEAR(course.steps[0].size_s, 0.03, 1e-3);
  EXPECT_NEAR(course.steps[1].size_s, -0.03, 1e-3);
}

TEST(ClockCourseModel, SmoothDriftHasNoSteps) {
  const auto parabola = [](double time_s) { return 0.05 * std::pow(time_s / kLengthS, 2); };
  EXPECT_EQ(Choose(parabola).kind, CourseKind::kCurve);
  const auto line = [](double time_s) { return 5e-4 * time_s; };
  EXPECT_EQ(Choose(line).kind, CourseKind::kSlope);
  const auto wave = [](double time_s) { return 0.01 * std::sin(0.1 * time_s); };
  const ClockCourse course = Choose(wave);
  EXPECT_EQ(course.kind, CourseKind::kCorners);
  EXPECT_THAT(course.steps, IsEmpty());
  EXPECT_LT(WorstS(course, wave), 3e-3);
}

TEST(ClockCourseModel, RateThatChangesIsACorner) {
  const auto truth = [](double time_s) { return 0.001 * std::max(0.0, time_s - 30); };
  const ClockCourse course = Choose(truth);
  ASSERT_EQ(course.kind, CourseKind::kCorners);
  ASSERT_THAT(course.corners, SizeIs(1));
  EXPECT_NEAR(course.corners[0].slope, 0.001, 1e-4);
  EXPECT_LT(WorstS(course, truth), 2e-3);
}

}  // namespace
}  // namespace rigcal::server
