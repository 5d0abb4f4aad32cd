// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/wand_choice.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace rigcal::agent::wand_choice_test {
namespace {

constexpr double kMinConfidence = 0.6;

struct Kind {
  int first_blob = 0;
  double cost = 0;
  double grey = 200;
};

// All three markers whole. The confidence is 0.5 at a cost of 11.
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
  wand.cost = kind.cost;
  wand.confidence = 1 / (1 + std::exp((kind.cost - 11) / 2.5));
  return wand;
}

Verdict Chosen(const std::vector<Kind>& kinds) {
  std::vector<VerifiedWand> wands;
  for (const Kind& kind : kinds) wands.push_back(Wand(kind));
  return ChooseWand(kMinConfidence, &wands);
}

TEST(ChooseWand, NoneOfNoneOrOfWhatIsNotConfident) {
  EXPECT_FALSE(Chosen({}).wand.has_value());
  EXPECT_FALSE(Chosen({{.cost = 20}}).wand.has_value());
}

TEST(ChooseWand, TwoThatAreEquallyGoodAreAmbiguous) {
  EXPECT_TRUE(Chosen({{.first_blob = 0, .cost = 3}, {.first_blob = 3, .cost = 5}}).ambiguous);
}

// It has one as its reflection in a floor.
TEST(ChooseWand, TheBrighterOneOfTwo) {
  const Verdict verdict = Chosen(
      {{.first_blob = 0, .cost = 3, .grey = 110}, {.first_blob = 3, .cost = 4, .grey = 200}});
  EXPECT_FALSE(verdict.ambiguous);
  ASSERT_TRUE(verdict.wand.has_value());
  EXPECT_EQ(verdict.wand->blobs[0], 3);
  // But not something that is brighter and much less likely.
  const Verdict other = Chosen(
      {{.first_blob = 0, .cost = -8, .grey = 110}, {.first_blob = 3, .cost = 4, .grey = 200}});
  ASSERT_TRUE(other.wand.has_value());
  EXPECT_EQ(other.wand->blobs[0], 0);
}

}  // namespace
}  // namespace rigcal::agent::wand_choice_test
