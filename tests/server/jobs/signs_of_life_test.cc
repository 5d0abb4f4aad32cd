// SPDX-License-Identifier: Apache-2.0
#include "server/jobs/signs_of_life.h"

#include <gtest/gtest.h>

namespace rigcal::server::signs_of_life_test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using State = SignsOfLife::State;

constexpr SilenceLimits kLimits{seconds(30), seconds(60), seconds(900)};

// Looks every 50 ms for so long.
State LookFor(milliseconds time, SignsOfLife::Time* now, SignsOfLife* life) {
  State state = State::kAlive;
  for (milliseconds passed{0}; passed < time; passed += milliseconds(50)) {
    *now += milliseconds(50);
    state = life->Look(*now);
  }
  return state;
}

TEST(SignsOfLife, DoubtsAndThenEndsWhatIsSilent) {
  SignsOfLife::Time now{};
  SignsOfLife life(kLimits, now);
  EXPECT_EQ(LookFor(milliseconds(29'950), &now, &life), State::kAlive);
  EXPECT_EQ(LookFor(milliseconds(50), &now, &life), State::kDoubtful);
  EXPECT_EQ(LookFor(milliseconds(29'950), &now, &life), State::kDoubtful);
  EXPECT_EQ(LookFor(milliseconds(50), &now, &life), State::kSilent);
}

TEST(SignsOfLife, OneSignIsEnough) {
  SignsOfLife::Time now{};
  SignsOfLife life(kLimits, now);
  for (int i = 0; i < 5; ++i) {
    EXPECT_EQ(LookFor(seconds(50), &now, &life), State::kDoubtful);
    life.Hear(false);
    EXPECT_EQ(life.Look(now), State::kAlive);
  }
}

TEST(SignsOfLife, WhatWorksWithoutProgressIsStuckInTheEnd) {
  SignsOfLife::Time now{};
  SignsOfLife life(kLimits, now);
  for (int i = 0; i < 89; ++i) {
    EXPECT_EQ(LookFor(seconds(10), &now, &life), State::kAlive);
    life.Hear(false);
  }
  EXPECT_EQ(LookFor(seconds(10), &now, &life), State::kStuck);
  life.Hear(true);
  EXPECT_EQ(life.Look(now), State::kAlive);
}

// A server that was stopped for an hour, or a machine that slept, has missed nothing.
TEST(SignsOfLife, TimeInWhichNobodyLookedIsNoSilence) {
  SignsOfLife::Time now{};
  SignsOfLife life(kLimits, now);
  EXPECT_EQ(LookFor(seconds(10), &now, &life), State::kAlive);
  now += seconds(3600);
  EXPECT_EQ(life.Look(now), State::kAlive);
  EXPECT_LT(life.silence(), seconds(15));
}

}  // namespace
}  // namespace rigcal::server::signs_of_life_test
