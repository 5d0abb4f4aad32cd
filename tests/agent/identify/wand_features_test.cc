// SPDX-License-Identifier: Apache-2.0
// The features of a candidate, and the score that is made of them.
#include "agent/identify/wand_features.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace rigcal::agent::wand_features_test {
namespace {

VerifiedWand Wand() {
  VerifiedWand wand;
  for (int k = 0; k < 3; ++k) {
    MarkerCentre& centre = wand.centres.emplace_back();
    centre.radius_px = 4;
    centre.contrast_grey = 200;
    centre.noise_grey = 2;
    centre.plateau_grey = Eigen::Vector3d(20, 120, 200);
  }
  return wand;
}

SphereOutline Round() {
  SphereOutline outline;
  outline.radius_px = 4;
  outline.on_outline = 1;
  outline.off_outline = 0;
  outline.residual = 0.5;
  return outline;
}

double LogOdds(VerifiedWand wand, const SphereOutline& middle) {
  const SphereOutline round = Round();
  MeasureLikeness(&wand);
  MeasureShapes({&round, &middle, &round}, &wand);
  return WandLogOdds(wand.features, true);
}

TEST(WandFeatures, APerfectWandHasNone) {
  VerifiedWand wand = Wand();
  const SphereOutline round = Round();
  MeasureLikeness(&wand);
  MeasureShapes({&round, &round, &round}, &wand);
  for (size_t k = 0; k < kWandFeatureCount; ++k) {
    EXPECT_NEAR(wand.features[static_cast<WandFeature>(k)], 0, 1e-9)
        << WeightOf(static_cast<WandFeature>(k)).name;
  }
  EXPECT_EQ(WandLogOdds(wand.features, true), MostLogOdds(true));
  EXPECT_GT(ConfidenceOf(MostLogOdds(true)), 0.9);
}

TEST(WandFeatures, EachDoubtMakesAWandLessLikely) {
  const double sure = LogOdds(Wand(), Round());
  VerifiedWand wand = Wand();
  wand.fit.cost = 4;
  EXPECT_LT(LogOdds(wand, Round()), sure);
  wand = Wand();
  wand.fit.tilt_rad = 1.3;
  EXPECT_LT(LogOdds(wand, Round()), sure);
  wand = Wand();
  wand.centres[1].plateau_grey *= 0.4;
  EXPECT_LT(LogOdds(wand, Round()), sure);
  wand = Wand();
  wand.centres[1].plateau_grey = {200, 120, 20};
  EXPECT_LT(LogOdds(wand, Round()), sure);
  SphereOutline odd = Round();
  odd.off_outline = 0.3;
  EXPECT_LT(LogOdds(Wand(), odd), sure);
  odd = Round();
  odd.residual = 3;
  EXPECT_LT(LogOdds(Wand(), odd), sure);
  odd = Round();
  odd.stretch = {0.4, 0};
  EXPECT_LT(LogOdds(Wand(), odd), sure);
}

TEST(WandFeatures, AMissingOutlineIsADoubt) {
  VerifiedWand wand = Wand();
  const SphereOutline round = Round();
  MeasureLikeness(&wand);
  MeasureShapes({&round, nullptr, &round}, &wand);
  EXPECT_EQ(wand.features[WandFeature::kNoOutline], 1);
  wand.centres[1].radius_px = 20;
  MeasureShapes({&round, nullptr, &round}, &wand);
  EXPECT_EQ(wand.features[WandFeature::kNoOutline], 0);
  EXPECT_EQ(wand.features[WandFeature::kNoLargeOutline], 1);
}

// Whatever is measured, the odds have a lower bound and are a number.
TEST(WandFeatures, TheScoreIsBounded) {
  WandFeatures features;
  for (size_t k = 0; k < kWandFeatureCount; ++k) {
    const auto feature = static_cast<WandFeature>(k);
    features[feature] = std::numeric_limits<double>::infinity();
    EXPECT_GE(WeightOf(feature).dark, 0) << WeightOf(feature).name;
    EXPECT_GE(WeightOf(feature).lit, 0) << WeightOf(feature).name;
  }
  for (const bool is_lit : {false, true}) {
    EXPECT_TRUE(std::isfinite(WandLogOdds(features, is_lit)));
    EXPECT_LT(ConfidenceOf(WandLogOdds(features, is_lit)), 1e-3);
  }
}

}  // namespace
}  // namespace rigcal::agent::wand_features_test
