// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/wand_evidence.h"

#include <gtest/gtest.h>

#include <cmath>

namespace rigcal::agent::wand_evidence_test {
namespace {

// Two markers whose colours are `away_rad` apart.
VerifiedWand Wand(double away_rad) {
  VerifiedWand wand;
  for (const double turn : {0.0, away_rad}) {
    MarkerCentre centre;
    centre.contrast_grey = 200;
    centre.plateau_grey = 200 * Eigen::Vector3d(std::cos(turn), std::sin(turn), 0);
    wand.centres.push_back(centre);
  }
  return wand;
}

TEST(ColourCost, IsThatOfMarkersOfDifferentColours) {
  EXPECT_EQ(ColourCost(Wand(0.06)), 0);
  EXPECT_GT(ColourCost(Wand(0.08)), 1.5);
  EXPECT_GT(ColourCost(Wand(0.1)), 4);
  EXPECT_LT(ColourCost(Wand(0.5)), 6);
  VerifiedWand clipped = Wand(0.1);
  clipped.centres[0].plateau_grey.x() = 250;
  EXPECT_EQ(ColourCost(clipped), 0);
  VerifiedWand other = Wand(0.2);
  other.centres[0].plateau_grey *= 1.25;
  EXPECT_GT(ColourCost(other), 4);
}

TEST(WholeOutlineCost, IsThatOfThreeThatAllFitBadly) {
  const OutlineMatch good{0.55, 0}, rough{0.75, 0.05}, none;
  EXPECT_EQ(WholeOutlineCost({good, good, good}), 0);
  EXPECT_EQ(WholeOutlineCost({good, good, rough}), 0);  // one may be before a window
  EXPECT_GT(WholeOutlineCost({rough, rough, rough}), 3);
  EXPECT_GT(WholeOutlineCost({none, none, good}), 1.5);
}

}  // namespace
}  // namespace rigcal::agent::wand_evidence_test
