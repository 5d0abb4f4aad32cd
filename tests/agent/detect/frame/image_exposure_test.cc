// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/frame/image_exposure.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace rigcal::agent::image_exposure_test {
namespace {

TEST(LookAtExposure, TellsBlackAndSaturatedPictures) {
  std::vector<uint8_t> pixels(64 * 64, 5);
  const ImageView view{pixels.data(), 64, 64, 64, PixelFormat::kMono8};
  EXPECT_EQ(LookAtExposure(view), ImageExposure::kBlack);
  pixels.assign(pixels.size(), 255);
  EXPECT_EQ(LookAtExposure(view), ImageExposure::kSaturated);
  pixels.assign(pixels.size(), 100);
  EXPECT_EQ(LookAtExposure(view), ImageExposure::kUsable);
}

TEST(LightTimeSigma, IsWhatThePhaseLeavesOpen) {
  Target target;
  target.blink_hz = {500};
  EXPECT_EQ(LightTimeSigma(0, target), 0);
  // Whole periods: the light's mean time goes evenly through a quarter period on either side.
  EXPECT_NEAR(LightTimeSigma(0.004, target), 0.25 * 0.002 / std::sqrt(3.0), 1e-6);
  EXPECT_NEAR(LightTimeSigma(0.050, target), 0.25 * 0.002 / std::sqrt(3.0), 1e-6);
  // Half a period more is nearly the same at both ends.
  EXPECT_LT(LightTimeSigma(0.005, target), 5e-5);
  EXPECT_GT(LightTimeSigma(0.005, target), 1e-5);
  target.blink_hz.clear();
  EXPECT_EQ(LightTimeSigma(0.005, target), 0);
}

TEST(ShortLightTimeSigma, IsThatOfExposuresShorterThanABlink) {
  Target target;
  target.blink_hz = {500};
  EXPECT_EQ(ShortLightTimeSigma(0, target), 0);
  EXPECT_EQ(ShortLightTimeSigma(0.001, target), LightTimeSigma(0.001, target));
  EXPECT_GT(ShortLightTimeSigma(0.001, target), 1e-4);
  EXPECT_LT(ShortLightTimeSigma(0.001, target), 5e-4);
  EXPECT_EQ(ShortLightTimeSigma(0.004, target), 0);
  Target silent;
  EXPECT_EQ(ShortLightTimeSigma(0.001, silent), ShortLightTimeSigma(0.001, target));
}

}  // namespace
}  // namespace rigcal::agent::image_exposure_test
