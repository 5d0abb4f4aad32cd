// SPDX-License-Identifier: Apache-2.0
#include "client/watch/watch_keys.h"

#include <gtest/gtest.h>

namespace rigcal::client::watch_keys_test {
namespace {

using Act = WatchKeys::Act;

TEST(WatchKeys, StoppingTakesTwoDifferentKeys) {
  WatchKeys keys;
  EXPECT_EQ(keys.Press('y', "wave"), Act::kNone);
  EXPECT_EQ(keys.Press('s', "wave"), Act::kAsk);
  EXPECT_EQ(keys.Press(0, "wave"), Act::kNone);
  EXPECT_EQ(keys.Press('y', "wave"), Act::kStop);
  EXPECT_EQ(keys.Press('y', "wave"), Act::kNone);
}

TEST(WatchKeys, AKeyHeldDownStopsNothing) {
  WatchKeys keys;
  EXPECT_EQ(keys.Press('s', "wave"), Act::kAsk);
  EXPECT_EQ(keys.Press('s', "wave"), Act::kKeep);
  EXPECT_EQ(keys.Press('s', "wave"), Act::kAsk);
  EXPECT_EQ(keys.Press('x', "wave"), Act::kKeep);
  EXPECT_EQ(keys.Press('y', "wave"), Act::kNone);
}

TEST(WatchKeys, AnotherSessionThanTheOneAskedAboutIsKept) {
  WatchKeys keys;
  EXPECT_EQ(keys.Press('s', "wave"), Act::kAsk);
  EXPECT_EQ(keys.Press('y', "next"), Act::kKeep);
}

TEST(WatchKeys, QLeavesAlsoWithAQuestionOpen) {
  WatchKeys keys;
  EXPECT_EQ(keys.Press('s', "wave"), Act::kAsk);
  EXPECT_EQ(keys.Press('q', "wave"), Act::kLeave);
}

}  // namespace
}  // namespace rigcal::client::watch_keys_test
