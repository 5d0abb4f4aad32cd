// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/wand_choice.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace rigcal::agent::wand_choice_test {
namespace {

constexpr double kMinConfidence = 0.6;

struct Kind {
  int first_blob = 0;
  double log_odds = 0;
  double grey = 200;
};

// All three markers whole.
VerifiedWand Wand(const Kind& kind) {
  VerifiedWand wand;
  for (int k = 0; k < 3; ++k) {
    wand.blobs.push_back(kind.first_blob + k);
    MarkerCentre& centre = wand.centres.emplace_back();
    centre.centre_px = {100.0 * kind.first_blob + 40.0 * k, 50};
    centre.radius_px = 8;
    centre.contrast_grey = kind.grey;
    centre.plateau_grey = Eigen::Vector3d::Constant(kind.grey);
    wand.whole.push_back(true);
  }
  wand.log_odds = kind.log_odds;
  wand.confidence = ConfidenceOf(kind.log_odds);
  return wand;
}

Verdict Chosen(const std::vector<Kind>& kinds) {
  std::vector<VerifiedWand> wands;
  for (const Kind& kind : kinds) wands.push_back(Wand(kind));
  return ChooseWand(kMinConfidence, &wands);
}

TEST(ChooseWand, NoneOfNoneOrOfWhatIsNotConfident) {
  EXPECT_FALSE(Chosen({}).wand.has_value());
  EXPECT_FALSE(Chosen({{.log_odds = -3}}).wand.has_value());
}

TEST(ChooseWand, TwoThatAreEquallyGoodAreAmbiguous) {
  EXPECT_TRUE(
      Chosen({{.first_blob = 0, .log_odds = 3}, {.first_blob = 3, .log_odds = 2}}).ambiguous);
}

// It has one as its reflection in a floor.
TEST(ChooseWand, TheBrighterOneOfTwo) {
  const Verdict verdict = Chosen({{.first_blob = 0, .log_odds = 3, .grey = 110},
                                  {.first_blob = 3, .log_odds = 2.6, .grey = 200}});
  EXPECT_FALSE(verdict.ambiguous);
  ASSERT_TRUE(verdict.wand.has_value());
  EXPECT_EQ(verdict.wand->blobs[0], 3);
  // But not something that is brighter and much less likely.
  const Verdict other = Chosen({{.first_blob = 0, .log_odds = 7, .grey = 110},
                                {.first_blob = 3, .log_odds = 3, .grey = 200}});
  ASSERT_TRUE(other.wand.has_value());
  EXPECT_EQ(other.wand->blobs[0], 0);
}

// The same spheres the other way round: the poses say which labels are right.
TEST(ChooseWand, LabelsAreAsCertainAsThePosesDiffer) {
  for (const double worse : {0.0, 4.0, 40.0}) {
    std::vector<VerifiedWand> wands = {Wand({.log_odds = 4}), Wand({.log_odds = 4 - 0.4 * worse})};
    std::reverse(wands[1].blobs.begin(), wands[1].blobs.end());
    std::reverse(wands[1].centres.begin(), wands[1].centres.end());
    wands[1].fit.cost = worse;
    const Verdict verdict = ChooseWand(kMinConfidence, &wands);
    ASSERT_TRUE(verdict.wand.has_value()) << worse;
    // exp(chi-squared / 2) is the ratio of the likelihoods.
    EXPECT_NEAR(verdict.wand->label_confidence, std::min(0.999, 1 / (1 + std::exp(-0.5 * worse))),
                1e-9);
  }
}

}  // namespace
}  // namespace rigcal::agent::wand_choice_test
