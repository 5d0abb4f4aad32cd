// SPDX-License-Identifier: Apache-2.0
#include "server/access/peer_conduct.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace rigcal::testing::peer_conduct_test {
namespace {

using server::PeerConduct;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr char kAgent[] = "rigcal://agents/pc1";

class PeerConductTest : public ::testing::Test {
 protected:
  // How many of `count` calls at one moment are let in.
  int Begin(int count) {
    int good = 0;
    for (int i = 0; i < count; ++i) good += conduct_.BeginCall(kAgent, now_) ? 1 : 0;
    return good;
  }
  int BansFor() { return static_cast<int>(conduct_.Ban(kAgent, "why", now_).count()); }

  PeerConduct conduct_{{.unfinished_calls = 100, .window = seconds(10)}};
  PeerConduct::Clock::time_point now_ = PeerConduct::Clock::time_point(seconds(1000));
};

TEST_F(PeerConductTest, CallsThatEndAreNoFlood) {
  for (int i = 0; i < 10'000; ++i) {
    EXPECT_EQ(Begin(1), 1);
    conduct_.EndCall(kAgent);
    now_ += milliseconds(1);
  }
}

TEST_F(PeerConductTest, TooManyUnfinishedCallsAreOne) {
  EXPECT_EQ(Begin(150), 100);
  EXPECT_TRUE(conduct_.BeginCall("rigcal://agents/pc2", now_));  // another peer
  for (int i = 0; i < 60; ++i) conduct_.EndCall(kAgent);
  EXPECT_EQ(Begin(20), 10);
}

TEST_F(PeerConductTest, CallsThatLastCountOnlyWhileTheyAreNew) {
  EXPECT_EQ(Begin(90), 90);
  now_ += seconds(12);
  EXPECT_EQ(Begin(90), 90);
  // Those of before may end now; the count does not fall below what is open.
  for (int i = 0; i < 90; ++i) conduct_.EndCall(kAgent);
  EXPECT_EQ(Begin(100), 100);
  EXPECT_EQ(Begin(1), 0);
}

TEST_F(PeerConductTest, AnEndWithoutABeginningIsNothing) {
  conduct_.EndCall(kAgent);
  EXPECT_EQ(Begin(101), 100);
}

TEST_F(PeerConductTest, EachBanIsLongerUntilItIsForgiven) {
  EXPECT_FALSE(conduct_.FindBan(kAgent, now_));
  EXPECT_EQ(BansFor(), 5);
  EXPECT_EQ(BansFor(), 5);  // it is banned already
  const auto ban = conduct_.FindBan(kAgent, now_ + milliseconds(4500));
  ASSERT_TRUE(ban);
  EXPECT_EQ(ban->why, "why");
  EXPECT_EQ(ban->left, seconds(1));
  EXPECT_FALSE(conduct_.FindBan("rigcal://agents/pc2", now_));
  for (const int next : {10, 20, 40, 80, 160, 300, 300}) {
    now_ += seconds(301);
    EXPECT_FALSE(conduct_.FindBan(kAgent, now_));
    EXPECT_EQ(BansFor(), next);
  }
  now_ += seconds(300 + 601);
  EXPECT_EQ(BansFor(), 5);
}

}  // namespace
}  // namespace rigcal::testing::peer_conduct_test
