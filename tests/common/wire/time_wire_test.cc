// SPDX-License-Identifier: Apache-2.0
#include "common/wire/time_wire.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/testing/status_matchers.h"

namespace rigcal::testing::time_wire_test {
namespace {

using ::testing::HasSubstr;

google::protobuf::Duration Duration(int64_t seconds, int32_t nanos) {
  google::protobuf::Duration duration;
  duration.set_seconds(seconds);
  duration.set_nanos(nanos);
  return duration;
}

TEST(TimeWire, DurationsKeepNanoseconds) {
  for (const double seconds : {0.0, 0.01, 10.0, 599.999999999, -2.5}) {
    EXPECT_NEAR(wire::SecondsOf(wire::ToDuration(seconds)), seconds, 1e-9);
    EXPECT_THAT(wire::CheckDuration(wire::ToDuration(seconds), "wait"), IsOk());
  }
  EXPECT_EQ(wire::ToDuration(-2.5).seconds(), -2);
  EXPECT_EQ(wire::ToDuration(-2.5).nanos(), -500'000'000);
}

TEST(TimeWire, MillisecondsAreRoundedUp) {
  ASSERT_OK_AND_ASSIGN(const uint32_t none, wire::MillisecondsOf({}, "wait"));
  EXPECT_EQ(none, 0u);
  ASSERT_OK_AND_ASSIGN(const uint32_t least, wire::MillisecondsOf(Duration(0, 1), "wait"));
  EXPECT_EQ(least, 1u);
  ASSERT_OK_AND_ASSIGN(const uint32_t exact,
                       wire::MillisecondsOf(Duration(5, 250'000'000), "wait"));
  EXPECT_EQ(exact, 5250u);
  EXPECT_THAT(wire::MillisecondsOf(Duration(-1, 0), "wait"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("wait: -1 s")));
  EXPECT_THAT(wire::MillisecondsOf(Duration(5'000'000, 0), "wait"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("wait")));
}

TEST(TimeWire, WhatIsNoDurationIsRefused) {
  for (const auto& bad : {Duration(1, -1), Duration(-1, 1), Duration(0, 1'000'000'000),
                          Duration(INT64_MAX, 0), Duration(INT64_MIN, 0)}) {
    EXPECT_THAT(wire::CheckDuration(bad, "wait"),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("wait: ")));
  }
}

}  // namespace
}  // namespace rigcal::testing::time_wire_test
