// SPDX-License-Identifier: Apache-2.0
#include "server/session/change_notifier.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "tests/testing/status_matchers.h"

namespace rigcal::testing::change_notifier_test {
namespace {

using server::ChangeNotifier;
using ::testing::HasSubstr;

TEST(ChangeNotifier, WakesForEachChangeOfItsResource) {
  ChangeNotifier notifier(2);
  int first = 0;
  int second = 0;
  ASSERT_OK_AND_ASSIGN(const auto one, notifier.Add("s-1", [&] { ++first; }));
  ASSERT_OK_AND_ASSIGN(const auto two, notifier.Add("s-2", [&] { ++second; }));
  EXPECT_EQ(first, 0);
  notifier.Notify("s-1");
  notifier.Notify("s-1");
  notifier.Notify("s-3");
  EXPECT_EQ(first, 2);
  EXPECT_EQ(second, 0);
}

TEST(ChangeNotifier, LimitsWatchesAndTakesNewOnesWhenOldOnesEnd) {
  ChangeNotifier notifier(1);
  {
    ASSERT_OK_AND_ASSIGN(const auto watch, notifier.Add("s-1", [] {}));
    EXPECT_THAT(notifier.Add("s-2", [] {}),
                StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("watching")));
  }
  EXPECT_THAT(notifier.Add("s-2", [] {}), IsOk());
}

TEST(ChangeNotifier, NobodyIsWokenAfterTheWatchHasEnded) {
  ChangeNotifier notifier(1);
  std::atomic<bool> stop = false;
  std::thread changer([&] {
    while (!stop) notifier.Notify("s-1");
  });
  for (int i = 0; i < 1000; ++i) {
    const auto alive = std::make_unique<std::atomic<int>>(0);
    ASSERT_OK_AND_ASSIGN(const auto watch, notifier.Add("s-1", [&alive] { ++*alive; }));
  }  // a wake after the end would use freed memory
  stop = true;
  changer.join();
}

}  // namespace
}  // namespace rigcal::testing::change_notifier_test
