// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/pacer.h"

#include <gtest/gtest.h>

#include <limits>
#include <thread>

namespace rigcal::agent::pacer_test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr int64_t kSecond = 1'000'000'000;
constexpr Pacer::Clock::time_point kNow{seconds(1000)};

TEST(Pacer, KeepsTheDistanceOfTheRows) {
  Pacer schedule(1);
  EXPECT_EQ(schedule.DueTime(50 * kSecond, kNow), kNow);
  // A later `now` does not move what is due: a source that was held up catches up.
  EXPECT_EQ(schedule.DueTime(51 * kSecond, kNow + seconds(5)), kNow + seconds(1));
  EXPECT_EQ(schedule.DueTime(51 * kSecond, kNow), kNow + seconds(1));
  EXPECT_EQ(schedule.DueTime(53 * kSecond, kNow), kNow + seconds(3));
}

TEST(Pacer, DividesByTheSpeed) {
  Pacer schedule(4);
  schedule.DueTime(0, kNow);
  EXPECT_EQ(schedule.DueTime(kSecond, kNow), kNow + milliseconds(250));
}

TEST(Pacer, TakesAStepBackwardsAsDueAtOnce) {
  Pacer schedule(1);
  schedule.DueTime(0, kNow);
  schedule.DueTime(2 * kSecond, kNow);
  EXPECT_EQ(schedule.DueTime(kSecond, kNow), kNow + seconds(2));
  EXPECT_EQ(schedule.DueTime(3 * kSecond, kNow), kNow + seconds(4));
}

TEST(Pacer, ShortensAGapThatADamagedStampMakes) {
  Pacer schedule(1);
  schedule.DueTime(std::numeric_limits<int64_t>::min(), kNow);
  EXPECT_EQ(schedule.DueTime(std::numeric_limits<int64_t>::max(), kNow), kNow + Pacer::kMaxGap);
}

TEST(Pacer, StopEndsAWaitAndEveryLaterOne) {
  Pacer pacer(1);
  pacer.Start();
  ASSERT_TRUE(pacer.Wait(0));
  std::thread stopper([&] { pacer.Stop(); });
  EXPECT_FALSE(pacer.Wait(kSecond * 3600));
  stopper.join();
  EXPECT_FALSE(pacer.Wait(0));
  pacer.Start();
  EXPECT_TRUE(pacer.Wait(0));
}

TEST(Pacer, DoesNotWaitAtMaxSpeed) {
  Pacer pacer(kMaxSpeed);
  pacer.Start();
  for (int64_t hour = 0; hour < 100'000; ++hour) ASSERT_TRUE(pacer.Wait(hour * 3600 * kSecond));
  pacer.Stop();
  EXPECT_FALSE(pacer.Wait(0));
}

}  // namespace
}  // namespace rigcal::agent::pacer_test
