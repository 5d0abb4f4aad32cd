// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/frames/exposure_plan.h"

#include <gtest/gtest.h>

#include <cmath>

namespace rigcal::exposure_plan_test {
namespace {

struct Light {
  double share = 0;
  double mean_time_s = 0;
};

Light LightOf(const std::vector<ExposurePart>& parts) {
  Light light;
  for (const ExposurePart& part : parts) {
    light.share += part.lit_share;
    light.mean_time_s += part.lit_share * part.dt_s;
  }
  if (light.share > 0) light.mean_time_s /= light.share;
  return light;
}

// By a million short moments.
Light Reference(double exposure_s, const BlinkTiming& blink) {
  constexpr int kMoments = 1000000;
  Light light;
  for (int i = 0; i < kMoments; ++i) {
    const double t = exposure_s * ((i + 0.5) / kMoments - 0.5);
    const double turns = (t + blink.phase_s) * blink.hz;
    if (turns - std::floor(turns) >= blink.duty) continue;
    light.share += 1.0 / kMoments;
    light.mean_time_s += t / kMoments;
  }
  if (light.share > 0) light.mean_time_s /= light.share;
  return light;
}

TEST(ExposurePlan, HoldsExactlyTheLightOfTheBlinks) {
  for (const double exposure_s : {0.0004, 0.005, 0.0133}) {
    for (const double duty : {0.1, 0.5, 0.9}) {
      for (const double phase_s : {0.0, 0.0003, 0.0019, -0.0007, 12345.6789}) {
        const BlinkTiming blink{500, duty, phase_s};
        const Light expected = Reference(exposure_s, blink);
        // One part when it is short enough, many otherwise: the same light at the same mean time.
        for (const double longest_s : {1.0, 1e-3, 2e-5}) {
          const Light light = LightOf(PlanExposure(exposure_s, blink, longest_s));
          EXPECT_NEAR(light.share, expected.share, 1e-5);
          // A moment more or less at each switching is what the reference may be wrong by.
          EXPECT_NEAR(light.mean_time_s, expected.mean_time_s, 2e-7);
        }
      }
    }
  }
}

TEST(ExposurePlan, CoversTheExposureInShortParts) {
  const auto parts = PlanExposure(0.005, {500, 0.5, 0.0004}, 1e-4);
  double sum = 0, mean_s = 0;
  for (const ExposurePart& part : parts) {
    sum += part.share;
    mean_s += part.share * part.dt_s;
    EXPECT_LE(part.share * 0.005, 1.0001e-4);
    EXPECT_TRUE(part.lit_share == 0 || part.lit_share == part.share);
  }
  EXPECT_NEAR(sum, 1, 1e-9);
  EXPECT_NEAR(mean_s, 0, 1e-12);
}

TEST(ExposurePlan, LightThatDoesNotBlinkIsOnAllTheTime) {
  EXPECT_NEAR(LightOf(PlanExposure(0.005, {0, 0.5, 0}, 1e-3)).share, 1, 1e-12);
  EXPECT_NEAR(LightOf(PlanExposure(0.005, {500, 1, 0}, 1e-3)).share, 1, 1e-12);
}

TEST(ExposurePlan, FastMotionDoesNotMakeEndlessParts) {
  EXPECT_LE(PlanExposure(0.005, {500, 0.5, 0}, 1e-12).size(), 5000u);
}

}  // namespace
}  // namespace rigcal::exposure_plan_test
