// SPDX-License-Identifier: Apache-2.0
#include "client/output/quantities.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <numbers>

#include "absl/time/time.h"

namespace rigcal::client::quantities_test {
namespace {

TEST(FormatFixed, NeverWritesANegativeZero) {
  EXPECT_EQ(FormatFixed(-0.0004, 3), "0.000");
  EXPECT_EQ(FormatFixed(-0.0006, 3), "-0.001");
  EXPECT_EQ(FormatFixed(-0.0, 1), "0.0");
  EXPECT_EQ(FormatFixed(-10, 0), "-10");
}

TEST(FormatFixed, SaysWhatIsNoNumber) {
  EXPECT_EQ(FormatFixed(std::numeric_limits<double>::quiet_NaN(), 3), "nan");
  EXPECT_EQ(FormatFixed(-std::numeric_limits<double>::infinity(), 3), "-inf");
}

TEST(FormatMagnitude, WritesNoPowersOfTen) {
  EXPECT_EQ(FormatMagnitude(-495.96), "-496");
  EXPECT_EQ(FormatMagnitude(0.052312), "0.05231");
  EXPECT_EQ(FormatMagnitude(9999.4), "9999");
  EXPECT_EQ(FormatMagnitude(9999.6), "10000");
  EXPECT_EQ(FormatMagnitude(-1e6), "-1000000");
  EXPECT_EQ(FormatMagnitude(-61855.6), "-61856");
}

TEST(FormatDuration, ChangesUnitAtAMinute) {
  EXPECT_EQ(FormatDuration(0.816), "0.82 s");
  EXPECT_EQ(FormatDuration(200.4), "3 min 20 s");
  EXPECT_EQ(FormatDuration(std::numeric_limits<double>::quiet_NaN()), "nan s");
  EXPECT_EQ(FormatDuration(1e300), "1e+300 s");
}

TEST(FormatBytes, PicksAUnit) {
  EXPECT_EQ(FormatBytes(12 << 10), "12 KiB");
  EXPECT_EQ(FormatBytes(1536 << 10), "1.5 MiB");
  EXPECT_EQ(FormatBytes(uint64_t{3} << 30), "3.0 GiB");
}

TEST(FormatTime, SaysWhatIsNotSet) { EXPECT_EQ(FormatTime(false, {}), "-"); }

TEST(FormatTime, NamesItsZone) {
  google::protobuf::Timestamp time;
  time.set_seconds(1'700'000'000);
  const absl::TimeZone zone = absl::LocalTimeZone();
  EXPECT_EQ(FormatTime(true, time),
            absl::FormatTime("%Y-%m-%d %H:%M:%S %Z", absl::FromUnixSeconds(time.seconds()), zone));
  EXPECT_THAT(FormatTime(true, time),
              ::testing::EndsWith(zone.At(absl::FromUnixSeconds(time.seconds())).zone_abbr));
}

}  // namespace
}  // namespace rigcal::client::quantities_test
