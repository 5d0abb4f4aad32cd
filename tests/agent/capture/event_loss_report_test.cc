// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/event_loss_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace rigcal::agent::event_loss_report_test {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

TEST(EventLossReport, SaysNothingOfAStreamThatIsWhole) {
  EventLossReport report;
  const BlinkWandCounts counts{
      .events = 70'000'000, .time_us = 10'000'000, .judged = 2000, .answered_percent = 198'000};
  EXPECT_THAT(report.Take(counts, false), IsEmpty());
  EXPECT_THAT(report.Take(counts, true), IsEmpty());
}

TEST(EventLossReport, SaysGapsOnceAndAllOfThemAtTheEnd) {
  EventLossReport report;
  BlinkWandCounts counts{.time_us = 1'000'000, .gaps = 4, .gap_us = 4000, .beside_gap = 2};
  EXPECT_THAT(report.Take(counts, false), IsEmpty());
  counts.gaps = 20, counts.gap_us = 25'000;
  EXPECT_THAT(report.Take(counts, false),
              ElementsAre(AllOf(HasSubstr("20 gaps, 25.0 ms in all (2.5 % of the time)"),
                                HasSubstr("2 wands"), HasSubstr("USB port"))));
  counts.gaps = 30;
  EXPECT_THAT(report.Take(counts, false), IsEmpty());
  EXPECT_THAT(report.Take(counts, true), ElementsAre(HasSubstr("30 gaps")));
  EXPECT_THAT(report.Take(counts, true), IsEmpty());
}

TEST(EventLossReport, SaysWhichShareOfTheBlinksIsAnswered) {
  EventLossReport report;
  BlinkWandCounts counts{.events = 8'000'000,
                         .time_us = 2'000'000,
                         .judged = 100,
                         .answered_percent = 7400,
                         .thinned = 90};
  EXPECT_THAT(report.Take(counts, false),
              ElementsAre(AllOf(HasSubstr("in 90 of 100 wands"), HasSubstr("74 % answer"),
                                HasSubstr("4.0 Mev/s"), HasSubstr("event_rate_limit"),
                                HasSubstr("refractory period"))));
  // A marker or two that something hides.
  counts.thinned = 19;
  EXPECT_THAT(EventLossReport().Take(counts, false), IsEmpty());
}

TEST(EventLossReport, SaysThatTooFewEventsAreLeftForAWand) {
  EventLossReport report;
  const BlinkWandCounts counts{
      .events = 4'000'000, .time_us = 2'000'000, .missed_looks = 8, .missed_answered_percent = 200};
  EXPECT_THAT(report.Take(counts, false),
              ElementsAre(AllOf(HasSubstr("no wand is found"), HasSubstr("about 25 %"),
                                HasSubstr("2.0 Mev/s"), HasSubstr("event_rate_limit"))));
}

}  // namespace
}  // namespace rigcal::agent::event_loss_report_test
