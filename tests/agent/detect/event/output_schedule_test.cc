// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/event/output_schedule.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <vector>

#include "tests/testing/status_matchers.h"

namespace rigcal::agent::output_schedule_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr int64_t kNever = std::numeric_limits<int64_t>::max();

std::vector<int64_t> TimesUntil(OutputSchedule* schedule, int64_t time_us) {
  std::vector<int64_t> times;
  while (schedule->due_us() <= time_us) times.push_back(schedule->Pop().time_us);
  return times;
}

TriggerEvent Edge(int64_t time_us, bool rising, uint8_t channel = 0) {
  return {.time_us = time_us, .channel = channel, .rising = rising};
}

TEST(OutputSchedule, RateIsOnMultiplesOfItsPeriod) {
  OutputSchedule schedule({.rate_hz = 300}, 1600);
  schedule.Start(9999);
  EXPECT_EQ(schedule.due_us(), 10'000 + 1600);
  EXPECT_THAT(TimesUntil(&schedule, 20'000), ElementsAre(10'000, 13'333, 16'667));
}

TEST(OutputSchedule, MomentsOfAPulse) {
  const auto times = [](TriggerInstant instant) {
    OutputSchedule schedule({.rate_hz = 0, .trigger = instant}, 1600);
    schedule.Start(0);
    EXPECT_EQ(schedule.due_us(), kNever);
    // Begins within a pulse.
    schedule.Take(Edge(500, false));
    for (const int64_t begin_us : {10'000, 30'000}) {
      schedule.Take(Edge(begin_us, true));
      schedule.Take(Edge(begin_us + 7001, false));
    }
    return TimesUntil(&schedule, 100'000);
  };
  EXPECT_THAT(times(TriggerInstant::kRising), ElementsAre(10'000, 30'000));
  EXPECT_THAT(times(TriggerInstant::kFalling), ElementsAre(500, 17'001, 37'001));
  EXPECT_THAT(times(TriggerInstant::kMiddle), ElementsAre(13'500, 33'500));
}

TEST(OutputSchedule, AMiddleIsDueWhenItIsKnown) {
  OutputSchedule schedule({.rate_hz = 0, .trigger = TriggerInstant::kMiddle}, 1600);
  schedule.Start(0);
  schedule.Take(Edge(10'000, true));
  schedule.Take(Edge(20'000, false));
  EXPECT_EQ(schedule.due_us(), 20'000);
}

TEST(OutputSchedule, NoiseAtTheInputIsCounted) {
  OutputSchedule schedule({.rate_hz = 0, .trigger = TriggerInstant::kRising}, 1600);
  schedule.Start(0);
  for (int64_t t = 0; t < 100'000; t += 10) schedule.Take(Edge(t, true));
  const size_t taken = TimesUntil(&schedule, 200'000).size();
  EXPECT_EQ(taken, 250u);
  EXPECT_EQ(schedule.dense_triggers(), 10'000u - taken);
}

TEST(OutputSchedule, OnlyTheChannelAskedFor) {
  OutputSchedule schedule({.rate_hz = 0, .trigger = TriggerInstant::kRising, .trigger_channel = 6},
                          1600);
  schedule.Start(0);
  schedule.Take(Edge(1000, true, 0));
  schedule.Take(Edge(2000, true, 6));
  EXPECT_THAT(TimesUntil(&schedule, 100'000), ElementsAre(2000));
}

TEST(OutputSchedule, BothByTheTimeTheyAreDue) {
  OutputSchedule schedule({.rate_hz = 100, .trigger = TriggerInstant::kRising}, 1600);
  schedule.Start(0);
  schedule.Take(Edge(12'345, true));
  EXPECT_THAT(TimesUntil(&schedule, 23'000), ElementsAre(0, 10'000, 12'345, 20'000));
}

TEST(OutputSchedule, ALongSilenceIsPassedOver) {
  OutputSchedule schedule({.rate_hz = 1000}, 1600);
  schedule.Start(0);
  // Years.
  schedule.Skip(0, 1'000'000'000'000'000);
  EXPECT_EQ(schedule.Pop().time_us, 1'000'000'000'000'000);
  schedule.Skip(1'000'000'000'000'000, 1'000'000'000'500'000);
  EXPECT_EQ(schedule.Pop().time_us, 1'000'000'000'001'000);
}

TEST(OutputSchedule, StartsAnewAtAnEarlierTime) {
  OutputSchedule schedule({.rate_hz = 100, .trigger = TriggerInstant::kRising}, 1600);
  schedule.Start(5'000'000);
  schedule.Take(Edge(5'000'100, true));
  schedule.Start(1'000'000);
  schedule.Take(Edge(1'000'100, true));
  EXPECT_THAT(TimesUntil(&schedule, 1'010'000), ElementsAre(1'000'000, 1'000'100));
}

TEST(OutputTimesOptions, Validate) {
  EXPECT_THAT(OutputTimesOptions{}.Validate(), IsOk());
  EXPECT_THAT((OutputTimesOptions{.rate_hz = 0}).Validate(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("neither")));
  EXPECT_THAT((OutputTimesOptions{.rate_hz = 5000, .trigger_channel = 99}).Validate(),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("rate is 5000"), HasSubstr("trigger_channel is 99"))));
  EXPECT_FALSE(
      (OutputTimesOptions{.rate_hz = std::numeric_limits<double>::quiet_NaN()}).Validate().ok());
}

}  // namespace
}  // namespace rigcal::agent::output_schedule_test
