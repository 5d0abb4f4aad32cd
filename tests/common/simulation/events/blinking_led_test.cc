// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "common/simulation/events/event_spheres.h"

namespace rigcal::blinking_led_test {
namespace {

TEST(BlinkingLed, ShinesDuringTheFirstOfItsPeriod) {
  const BlinkingLed led{.hz = 500, .duty = 0.25, .phase = 0.5};
  EXPECT_FALSE(led.IsLit(0));
  EXPECT_FALSE(led.IsLit(0.99e-3));
  EXPECT_TRUE(led.IsLit(1.01e-3));
  EXPECT_TRUE(led.IsLit(1.49e-3));
  EXPECT_FALSE(led.IsLit(1.51e-3));
  EXPECT_TRUE((BlinkingLed{.hz = 0}).IsLit(7));
}

TEST(BlinkingLed, StepsEndWhereItSwitches) {
  const BlinkingLed led{.hz = 500, .duty = 0.25, .phase = 0.5};
  std::vector<LightStep> steps;
  led.StepsOf(4000, 4000, &steps);  // two periods
  ASSERT_EQ(steps.size(), 5u);
  const double ends[] = {1000, 1500, 3000, 3500, 4000};
  for (size_t i = 0; i < 5; ++i) {
    EXPECT_NEAR(steps[i].end_us, ends[i], 1e-6);
    EXPECT_EQ(steps[i].lit, i % 2 == 1);
  }
}

TEST(BlinkingLed, StepsFillAStretchThatBeginsAtASwitch) {
  const BlinkingLed led{.hz = 1000, .duty = 0.5};
  std::vector<LightStep> steps;
  for (int k = 0; k < 2000; ++k) {
    led.StepsOf(250.0 * k, 250, &steps);
    ASSERT_EQ(steps.size(), 1u) << k;
    EXPECT_EQ(steps[0].end_us, 250);
    EXPECT_EQ(steps[0].lit, k % 4 < 2) << k;
  }
}

TEST(BlinkingLed, OneThatDoesNotBlinkIsOneStep) {
  std::vector<LightStep> steps;
  (BlinkingLed{}).StepsOf(10, 300, &steps);
  ASSERT_EQ(steps.size(), 1u);
  EXPECT_TRUE(steps[0].lit);
  (BlinkingLed{.hz = 100, .duty = 1}).StepsOf(0, 30000, &steps);
  for (const LightStep& step : steps) EXPECT_TRUE(step.lit);
  EXPECT_EQ(steps.back().end_us, 30000);
}

}  // namespace
}  // namespace rigcal::blinking_led_test
