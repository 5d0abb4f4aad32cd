// SPDX-License-Identifier: Apache-2.0
#include "server/live/clock_relation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

namespace rigcal::testing::clock_relation_test {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr int64_t kSecond = 1'000'000'000;

// A camera that counts from its start, on a PC that has run for an hour and whose UTC is right.
ClockSample SampleAt(int64_t time_s, int64_t camera_jump_ns = 0, int64_t utc_jump_ns = 0) {
  return {.device_ns = time_s * kSecond + camera_jump_ns,
          .host_monotonic_ns = (3600 + time_s) * kSecond,
          .host_utc_ns = (1'800'000'000 + time_s) * kSecond + utc_jump_ns,
          .uncertainty_ns = 100'000};
}

TEST(ClockRelation, GivesOffsetAndSpread) {
  server::ClockRelation clock;
  EXPECT_EQ(clock.OffsetNs(), std::nullopt);
  for (int i = 0; i < 20; ++i) {
    // 20 ppm of drift are no spread; half a millisecond to and fro is.
    clock.AddSample(0, SampleAt(i, 20'000 * i + (i % 2 == 0 ? 500'000 : -500'000)));
  }
  clock.AddAlignment({.host_monotonic_ns = 0, .server_minus_host_ns = 7, .uncertainty_ns = 1});
  EXPECT_NEAR(static_cast<double>(*clock.OffsetNs() - 1'800'000'000 * kSecond), 0, 2e6);
  EXPECT_NEAR(clock.SpreadS().value(), 0.5e-3, 0.1e-3);
  EXPECT_THAT(clock.jump(), IsEmpty());
}

TEST(ClockRelation, CorrectsTheHostByTheServer) {
  server::ClockRelation clock;
  clock.AddSample(0, SampleAt(0));
  clock.AddAlignment(
      {.host_monotonic_ns = 0, .server_minus_host_ns = -3600 * kSecond, .uncertainty_ns = 1000});
  EXPECT_EQ(clock.OffsetNs(), (1'800'000'000 - 3600) * kSecond);
}

TEST(ClockRelation, SeesTheCameraJump) {
  server::ClockRelation clock;
  for (int i = 0; i < 5; ++i) clock.AddSample(0, SampleAt(i));
  clock.AddSample(0, SampleAt(5, 2 * kSecond));
  EXPECT_THAT(clock.jump(), HasSubstr("camera's clock jumped by +2.000 s"));
  EXPECT_EQ(clock.OffsetNs(), (1'800'000'000 - 2) * kSecond);
}

TEST(ClockRelation, SeesTheWallClockSet) {
  server::ClockRelation clock;
  for (int i = 0; i < 5; ++i) clock.AddSample(0, SampleAt(i));
  clock.AddSample(0, SampleAt(5, 0, -3600 * kSecond));
  EXPECT_THAT(clock.jump(), HasSubstr("clock of its PC was set by -3600.000 s"));
}

TEST(ClockRelation, BearsAnyTime) {
  server::ClockRelation clock;
  constexpr int64_t kMost = std::numeric_limits<int64_t>::max();
  constexpr int64_t kLeast = std::numeric_limits<int64_t>::min();
  for (int i = 0; i < 8; ++i) {
    clock.AddSample(0, {.device_ns = i % 2 == 0 ? kMost : kLeast,
                        .host_monotonic_ns = i % 3 == 0 ? kMost : kLeast,
                        .host_utc_ns = i % 4 < 2 ? kLeast : kMost});
    clock.AddAlignment({.server_minus_host_ns = kLeast});
    EXPECT_TRUE(clock.OffsetNs().has_value());
    clock.SpreadS();
  }
}

}  // namespace
}  // namespace rigcal::testing::clock_relation_test
