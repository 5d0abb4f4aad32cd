// SPDX-License-Identifier: Apache-2.0
#include "common/target/csv_line.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <string>

namespace rigcal::csv_line_test {
namespace {

using ::testing::HasSubstr;

// The reason, kUnspecified for a good line.
RefusalReason ReasonOf(std::string_view line, int marker_count = 1) {
  Observation observation;
  const auto fault = ParseCsvLine(line, marker_count, 0.5, &observation);
  return fault ? fault->reason : RefusalReason::kUnspecified;
}

std::string WhatOf(std::string_view line, int marker_count = 1) {
  Observation observation;
  const auto fault = ParseCsvLine(line, marker_count, 0.5, &observation);
  return fault ? fault->what : "";
}

TEST(ParseCsvLine, ReadsTimeCentresAndCovariance) {
  Observation observation;
  ASSERT_FALSE(
      ParseCsvLine("598370000;570.5163;386.25;-1;-1;485.48;395.9925", 3, 0.5, &observation));
  EXPECT_EQ(observation.time_ns, 598370000);
  ASSERT_EQ(observation.markers.size(), 3u);
  EXPECT_TRUE(observation.markers[0].visible);
  EXPECT_EQ(observation.markers[0].centre_px, Eigen::Vector2d(570.5163, 386.25));
  EXPECT_EQ(observation.markers[0].covariance_px2,
            Eigen::Matrix2d(Eigen::Matrix2d::Identity() / 4));
  EXPECT_EQ(observation.markers[0].centre_kind, CentreKind::kImageBlob);
  EXPECT_FALSE(observation.markers[1].visible);
  EXPECT_EQ(observation.markers[1].centre_px, Eigen::Vector2d(0, 0));
  EXPECT_TRUE(observation.markers[2].visible);
}

TEST(ParseCsvLine, TakesARowWithoutWandAsAnEmptyObservation) {
  Observation observation;
  ASSERT_FALSE(ParseCsvLine("7;-1;-1;-1.0;-1.0", 2, 0.5, &observation));
  EXPECT_EQ(observation.VisibleCount(), 0);
}

TEST(ParseCsvLine, TakesBlanksAndCentresBesideTheImage) {
  EXPECT_EQ(ReasonOf(" 7 ; -0.4 ;\t2000.5 "), RefusalReason::kUnspecified);
  EXPECT_EQ(ReasonOf("7;-0.999;-1.001"), RefusalReason::kUnspecified);
}

TEST(ParseCsvLine, TakesTheWholeRangeOfTime) {
  Observation observation;
  ASSERT_FALSE(ParseCsvLine("9223372036854775807;1;1", 1, 0.5, &observation));
  EXPECT_EQ(observation.time_ns, std::numeric_limits<int64_t>::max());
  ASSERT_FALSE(ParseCsvLine("-9223372036854775808;1;1", 1, 0.5, &observation));
  EXPECT_EQ(observation.time_ns, std::numeric_limits<int64_t>::min());
  EXPECT_EQ(ReasonOf("9223372036854775808;1;1"), RefusalReason::kCsvBadTime);
}

TEST(ParseCsvLine, TakesADecimalPointInTimeOnlyWhereItIsExact) {
  Observation observation;
  ASSERT_FALSE(ParseCsvLine("598370000.000;1;1", 1, 0.5, &observation));
  EXPECT_EQ(observation.time_ns, 598370000);
  EXPECT_EQ(ReasonOf("598370000.;1;1"), RefusalReason::kUnspecified);
  EXPECT_EQ(ReasonOf("598370000.5;1;1"), RefusalReason::kCsvBadTime);
  ASSERT_FALSE(ParseCsvLine("1.700000001000000000e+18;1;1", 1, 0.5, &observation));
  EXPECT_EQ(observation.time_ns, 1'700'000'001'000'000'000);
  EXPECT_EQ(ReasonOf("5.98375e3;1;1"), RefusalReason::kCsvBadTime);
  EXPECT_EQ(ReasonOf("1e30;1;1"), RefusalReason::kCsvBadTime);
  EXPECT_THAT(WhatOf("1.04;1;1"), HasSubstr("seconds"));
  EXPECT_EQ(ReasonOf(".0;1;1"), RefusalReason::kCsvBadTime);
}

TEST(ParseCsvLine, RefusesOtherTimes) {
  for (const char* time : {"", "now", "12x", "0x10", "nan", "1 2", "+5"}) {
    EXPECT_EQ(ReasonOf(std::string(time) + ";1;1"), RefusalReason::kCsvBadTime) << time;
  }
}

TEST(ParseCsvLine, RefusesAnotherNumberOfFields) {
  EXPECT_EQ(ReasonOf("7;1;1;2"), RefusalReason::kCsvFieldCount);
  EXPECT_EQ(ReasonOf("7;1"), RefusalReason::kCsvFieldCount);
  EXPECT_EQ(ReasonOf("7"), RefusalReason::kCsvFieldCount);
  EXPECT_EQ(ReasonOf("7;1;1;"), RefusalReason::kCsvFieldCount);
  EXPECT_EQ(ReasonOf("7,1,1"), RefusalReason::kCsvFieldCount);
  EXPECT_EQ(ReasonOf("7;1;1;2;2", 2), RefusalReason::kUnspecified);
  EXPECT_THAT(WhatOf("7;1;1;2"), HasSubstr("4 fields instead of 3"));
}

TEST(ParseCsvLine, RefusesWhatIsNoNumber) {
  for (const char* field : {"abc", "1.5px", "1,5", "0x1p3", "--1", "1 2"}) {
    EXPECT_EQ(ReasonOf("7;1;" + std::string(field)), RefusalReason::kCsvNotANumber) << field;
  }
  EXPECT_THAT(WhatOf("7;1;1;2;oops", 2), HasSubstr("y1 is \"oops\""));
}

TEST(ParseCsvLine, RefusesWhatIsNotFinite) {
  for (const char* field : {"inf", "-infinity", "1e999"}) {
    EXPECT_EQ(ReasonOf("7;" + std::string(field) + ";1"), RefusalReason::kCsvNotFinite) << field;
  }
}

TEST(ParseCsvLine, TakesNanAndEmptyCellsAsAMarkerThatWasNotSeen) {
  for (const char* pair : {"nan;nan", "NaN;NAN", ";", " ; ", "-1;nan", "nan;"}) {
    Observation observation;
    ASSERT_FALSE(ParseCsvLine("7;1;2;" + std::string(pair), 2, 0.5, &observation)) << pair;
    EXPECT_TRUE(observation.markers[0].visible);
    EXPECT_FALSE(observation.markers[1].visible) << pair;
  }
}

TEST(ParseCsvLine, RefusesHalfAMarker) {
  EXPECT_EQ(ReasonOf("7;nan;5"), RefusalReason::kCsvHalfMarker);
  EXPECT_EQ(ReasonOf("7;5;"), RefusalReason::kCsvHalfMarker);
  EXPECT_EQ(ReasonOf("7;-1;5"), RefusalReason::kCsvHalfMarker);
  EXPECT_EQ(ReasonOf("7;5;-1"), RefusalReason::kCsvHalfMarker);
  EXPECT_THAT(WhatOf("7;1;1;5;-1", 2), HasSubstr("marker 1"));
}

TEST(ParseCsvLine, QuotesDamagedBytesSafelyAndNotAtLength) {
  EXPECT_THAT(WhatOf("7;1;\xff\x00z"), HasSubstr("\\xff"));
  EXPECT_LT(WhatOf("7;1;" + std::string(3000, 'q')).size(), 100u);
}

}  // namespace
}  // namespace rigcal::csv_line_test
