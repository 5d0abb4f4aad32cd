// SPDX-License-Identifier: Apache-2.0
#include "server/session/change_notifier.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <thread>

#include "tests/testing/status_matchers.h"

namespace rigcal::testing::change_notifier_test {
namespace {

using server::ChangeNotifier;
using std::chrono::milliseconds;
using ::testing::HasSubstr;

constexpr milliseconds kLong(60'000);
constexpr milliseconds kNoTime(0);

TEST(ChangeNotifier, BeginsWithAChangeAndTellsEachOnce) {
  ChangeNotifier notifier(1);
  ASSERT_OK_AND_ASSIGN(const auto watch, notifier.Add("s-1"));
  EXPECT_EQ(watch->Wait(kLong), ChangeNotifier::Event::kChanged);
  EXPECT_EQ(watch->Wait(kNoTime), ChangeNotifier::Event::kTimeout);
  notifier.Notify("s-1");
  notifier.Notify("s-1");
  EXPECT_EQ(watch->Wait(kLong), ChangeNotifier::Event::kChanged);
  EXPECT_EQ(watch->Wait(kNoTime), ChangeNotifier::Event::kTimeout);
}

TEST(ChangeNotifier, ChangesOfOthersWakeNobody) {
  ChangeNotifier notifier(2);
  ASSERT_OK_AND_ASSIGN(const auto watch, notifier.Add("s-1"));
  watch->Wait(kNoTime);
  notifier.Notify("s-2");
  EXPECT_EQ(watch->Wait(kNoTime), ChangeNotifier::Event::kTimeout);
}

TEST(ChangeNotifier, WakesTheOneWhoWaits) {
  ChangeNotifier notifier(1);
  ASSERT_OK_AND_ASSIGN(const auto watch, notifier.Add("s-1"));
  watch->Wait(kNoTime);
  std::thread changer([&] { notifier.Notify("s-1"); });
  EXPECT_EQ(watch->Wait(kLong), ChangeNotifier::Event::kChanged);
  changer.join();
}

TEST(ChangeNotifier, LimitsWatchesAndTakesNewOnesWhenOldOnesEnd) {
  ChangeNotifier notifier(1);
  {
    ASSERT_OK_AND_ASSIGN(const auto watch, notifier.Add("s-1"));
    EXPECT_THAT(notifier.Add("s-2"),
                StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("watching")));
  }
  EXPECT_THAT(notifier.Add("s-2"), IsOk());
}

TEST(ChangeNotifier, ShutdownEndsEveryWait) {
  ChangeNotifier notifier(1);
  ASSERT_OK_AND_ASSIGN(const auto watch, notifier.Add("s-1"));
  watch->Wait(kNoTime);
  std::thread ender([&] { notifier.Shutdown(); });
  EXPECT_EQ(watch->Wait(kLong), ChangeNotifier::Event::kShutdown);
  ender.join();
  EXPECT_FALSE(watch->Pause(kLong));
  EXPECT_THAT(notifier.Add("s-1"), StatusIs(absl::StatusCode::kUnavailable, HasSubstr("shut")));
}

}  // namespace
}  // namespace rigcal::testing::change_notifier_test
