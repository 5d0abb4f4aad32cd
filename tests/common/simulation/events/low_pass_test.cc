// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "common/simulation/events/event_pixels.h"
#include "common/simulation/world/random_stream.h"

namespace rigcal::low_pass_test {
namespace {

// The differential equation in many small steps.
TEST(LowPassAnswer, IsTheAnswerOfALowPass) {
  RandomStream draw{3, 1};
  for (int round = 0; round < 200; ++round) {
    const auto level = static_cast<float>(draw.Uniform(-3, 3));
    const auto from = static_cast<float>(draw.Uniform(-3, 3));
    const auto to = static_cast<float>(draw.Uniform(-3, 3));
    const auto tau = static_cast<float>(draw.Uniform(20, 400));
    const LowPassAnswer answer(level, from, to, 250, tau);
    double y = level;
    constexpr int kSteps = 25000;
    for (int i = 0; i < kSteps; ++i) {
      if (i % 5000 == 0) {
        ASSERT_NEAR(answer.At(static_cast<float>(i) / 100), y, 1e-3);
      }
      const double input = from + (to - from) * (i + 0.5) / kSteps;
      y += (input - y) * (1 - std::exp(-0.01 / static_cast<double>(tau)));
    }
    ASSERT_NEAR(answer.end(), y, 1e-4);
  }
}

TEST(LowPassAnswer, TurnsOnTheLineOfItsInput) {
  // Starts below, rises fast, then sinks with its input.
  const LowPassAnswer answer(0, 2, 1, 1000, 50);
  const float turn = answer.TurnUs();
  ASSERT_GT(turn, 0);
  ASSERT_LT(turn, 1000);
  EXPECT_NEAR(answer.At(turn), 2 - turn / 1000, 1e-4);
  EXPECT_GT(answer.At(turn), answer.At(turn - 20));
  EXPECT_GT(answer.At(turn), answer.At(turn + 20));
  EXPECT_LT(LowPassAnswer(0, 1, 2, 1000, 50).TurnUs(), 0);
  EXPECT_LT(LowPassAnswer(1, 1, 1, 1000, 50).TurnUs(), 0);
}

TEST(LowPassAnswer, ReachesALevelWhereItPassesIt) {
  RandomStream draw{3, 2};
  for (int round = 0; round < 2000; ++round) {
    const auto level = static_cast<float>(draw.Uniform(-3, 3));
    const auto from = static_cast<float>(draw.Uniform(-3, 3));
    const auto to = static_cast<float>(from + draw.Uniform(-1, 1));
    const auto tau = static_cast<float>(draw.Uniform(20, 400));
    const LowPassAnswer answer(level, from, to, 250, tau);
    const float turn = answer.TurnUs();
    const float high = turn > 0 && turn < 250 ? turn : 250;
    const float end = answer.At(high);
    const auto wanted = static_cast<float>(level + draw.Uniform(0.05, 0.95) * (end - level));
    const float at = answer.ReachUs(wanted, end > level, 0, high);
    ASSERT_GE(at, 0);
    ASSERT_LE(at, high);
    // Half a microsecond on either side encloses it.
    const float before = answer.At(std::max(0.0f, at - 0.5f)) - wanted;
    const float after = answer.At(std::min(high, at + 0.5f)) - wanted;
    ASSERT_LE(end > level ? before : -before, 1e-4) << round;
    ASSERT_GE(end > level ? after : -after, -1e-4) << round;
  }
}

TEST(LowPassAnswer, WhatHasBeenPassedIsReachedAtOnce) {
  EXPECT_NEAR(LowPassAnswer(0, 1, 1, 100, 50).ReachUs(-0.5f, true, 10, 100), 10, 0.5);
  EXPECT_NEAR(LowPassAnswer(0, -1, -2, 100, 50).ReachUs(0.5f, false, 10, 100), 10, 0.5);
}

TEST(LowPassSpeed, DarknessSlowsItToALimit) {
  const LowPassSpeed speed{50, 0.05f, 3};
  EXPECT_FLOAT_EQ(speed.TauUs(5), 50);
  EXPECT_NEAR(speed.TauUs(3 - std::log(3.0f)), 55, 0.01);
  EXPECT_NEAR(speed.TauUs(-20), 50 * (0.95 + 0.05 * std::exp(3)), 0.01);
  EXPECT_GT((LowPassSpeed{0, 0, 3}).TauUs(1), 0);
}

}  // namespace
}  // namespace rigcal::low_pass_test
