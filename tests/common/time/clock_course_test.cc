// SPDX-License-Identifier: Apache-2.0
#include "common/time/clock_course.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace rigcal::clock_course_test {
namespace {

using ::testing::AllOf;
using ::testing::DoubleNear;
using ::testing::ElementsAre;
using ::testing::Field;

auto Corner(int64_t camera_time_ns, double offset_s) {
  return AllOf(Field(&ClockCoursePoint::camera_time_ns, camera_time_ns),
               Field(&ClockCoursePoint::offset_s, DoubleNear(offset_s, 1e-12)));
}

// A jump of 30 ms between two rows, which are 100 ns apart, and nothing before and after.
const ClockCourseLine kJump = {{1000, 0}, {2000, 0}, {2100, -0.03}, {5000, -0.03}};

TEST(ClockCourse, NothingIsAddedWithoutOne) { EXPECT_EQ(ClockCourseOffsetS({}, 1234), 0); }

TEST(ClockCourse, IsLinearBetweenItsCorners) {
  EXPECT_DOUBLE_EQ(ClockCourseOffsetS(kJump, 1500), 0);
  EXPECT_DOUBLE_EQ(ClockCourseOffsetS(kJump, 2050), -0.015);
  EXPECT_DOUBLE_EQ(ClockCourseOffsetS(kJump, 2100), -0.03);
  EXPECT_DOUBLE_EQ(ClockCourseOffsetS(kJump, 3000), -0.03);
}

TEST(ClockCourse, IsConstantBeforeAndAfter) {
  EXPECT_DOUBLE_EQ(ClockCourseOffsetS(kJump, -5), 0);
  EXPECT_DOUBLE_EQ(ClockCourseOffsetS(kJump, 1'000'000), -0.03);
}

TEST(ClockCourse, OfUtcKeepsTheNanosecond) {
  const int64_t now_ns = 1'800'000'000'000'000'001;
  const ClockCourseLine line = {{now_ns, 1}, {now_ns + 2, 2}};
  EXPECT_DOUBLE_EQ(ClockCourseOffsetS(line, now_ns + 1), 1.5);
}

TEST(ClockCourse, FallsNoFasterThanTimePasses) {
  EXPECT_TRUE(KeepsOrder({}));
  EXPECT_TRUE(KeepsOrder({{0, 0}, {40'000'000, -0.03}}));
  EXPECT_TRUE(KeepsOrder({{0, 0}, {40'000'000, 0.5}}));
  EXPECT_FALSE(KeepsOrder({{0, 0}, {40'000'000, -0.041}}));
  EXPECT_FALSE(KeepsOrder(kJump));
}

TEST(ClockCourse, SumHasTheCornersOfBoth) {
  const ClockCourseLine slope = {{1000, 0}, {3000, 0.02}};
  EXPECT_THAT(Sum(kJump, slope),
              ElementsAre(Corner(1000, 0), Corner(2000, 0.01), Corner(2100, -0.019),
                          Corner(3000, -0.01), Corner(5000, -0.01)));
  EXPECT_EQ(Sum({}, kJump), kJump);
}

}  // namespace
}  // namespace rigcal::clock_course_test
