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
  double cost = 0, evidence = 0;
  double grey = 200;
};

// All three markers whole. The confidence is that of cost and evidence, about 0.5 at a cost of 11.
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
  wand.evidence = kind.evidence;
  wand.confidence = 1 / (1 + std::exp((kind.cost - kind.evidence - 11) / 2.5));
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
  EXPECT_FALSE(Chosen({{.cost = 3, .evidence = -12}}).wand.has_value());
}

TEST(ChooseWand, WhatIsNotConfidentDoesNotHideAWand) {
  const Verdict verdict =
      Chosen({{.first_blob = 0, .cost = 6.3, .evidence = -5}, {.first_blob = 3, .cost = 6.6}});
  EXPECT_FALSE(verdict.ambiguous);
  ASSERT_TRUE(verdict.wand.has_value());
  EXPECT_EQ(verdict.wand->blobs[0], 3);
}

TEST(ChooseWand, WithAMarkerThatIsNotWholeItMustBeMoreConfident) {
  for (const double least : {0.0, 0.3, 0.6, 1.0}) {
    std::vector<VerifiedWand> wands = {Wand({.cost = 3})};
    VerifiedWand& wand = wands[0];
    wand.confidence = least + 0.02 * (1 - least);
    EXPECT_TRUE(ChooseWand(least, &wands).wand.has_value()) << least;
    wand.whole[1] = false;
    EXPECT_EQ(ChooseWand(least, &wands).wand.has_value(), least == 0 || least == 1) << least;
    wand.confidence = least + 0.5 * (1 - least);
    EXPECT_TRUE(ChooseWand(least, &wands).wand.has_value()) << least;
  }
}

TEST(ChooseWand, TwoThatAreEquallyGoodAreAmbiguous) {
  EXPECT_TRUE(Chosen({{.first_blob = 0, .cost = 3}, {.first_blob = 3, .cost = 5}}).ambiguous);
  // By cost the first is clearly better, by evidence the second.
  EXPECT_TRUE(Chosen({{.first_blob = 0, .cost = 2, .evidence = 1},
                      {.first_blob = 3, .cost = 8, .evidence = 9}})
                  .ambiguous);
}

TEST(ChooseWand, EvidenceTellsAWandFromSomethingElse) {
  for (const double cost : {2.0, 8.0}) {
    const Verdict verdict = Chosen({{.first_blob = 0, .cost = 5, .evidence = -1},
                                    {.first_blob = 3, .cost = cost, .evidence = 15}});
    EXPECT_FALSE(verdict.ambiguous) << cost;
    ASSERT_TRUE(verdict.wand.has_value()) << cost;
    EXPECT_EQ(verdict.wand->blobs[0], 3) << cost;
  }
}

// It has one as its reflection in a floor.
TEST(ChooseWand, TheBrighterOneOfTwo) {
  const Verdict verdict = Chosen(
      {{.first_blob = 0, .cost = 3, .grey = 110}, {.first_blob = 3, .cost = 4, .grey = 200}});
  EXPECT_FALSE(verdict.ambiguous);
  ASSERT_TRUE(verdict.wand.has_value());
  EXPECT_EQ(verdict.wand->blobs[0], 3);
  // But not something that is brighter and much less likely.
  const Verdict other = Chosen({{.first_blob = 0, .cost = 3, .evidence = 15, .grey = 110},
                                {.first_blob = 3, .cost = 4, .grey = 200}});
  ASSERT_TRUE(other.wand.has_value());
  EXPECT_EQ(other.wand->blobs[0], 0);
}

}  // namespace
}  // namespace rigcal::agent::wand_choice_test
