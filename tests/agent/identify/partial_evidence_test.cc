// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/partial_evidence.h"

#include <gtest/gtest.h>

#include <cmath>

namespace rigcal::agent::partial_evidence_test {
namespace {

// Two markers whose colours are `away_rad` apart, and one that is hidden.
VerifiedWand Wand(double away_rad) {
  VerifiedWand wand;
  for (const double turn : {0.0, away_rad}) {
    MarkerCentre centre;
    centre.contrast_grey = 200;
    centre.plateau_grey = 200 * Eigen::Vector3d(std::cos(turn), std::sin(turn), 0);
    wand.centres.push_back(centre);
  }
  wand.centres.emplace_back();
  return wand;
}

double Evidence(const WandCandidate& candidate, double away_rad = 0.02, double unresolved = 0,
                bool in_room = true) {
  return PartialEvidence(candidate, Wand(away_rad), unresolved, in_room);
}

TEST(PartialEvidence, AStickAndASliverAreMore) {
  WandCandidate part, stick, sliver, unseen;
  part.partial_share = stick.partial_share = 0.3;
  stick.has_stick = true;
  sliver.is_sliver = true;
  EXPECT_GT(Evidence(stick), Evidence(part) + 3);
  // The rim of something in a lit room is a sliver, too.
  EXPECT_GT(Evidence(sliver), Evidence(part));
  EXPECT_LT(Evidence(sliver), Evidence(part) + 3);
  EXPECT_GT(Evidence(sliver, 0, 0, false), Evidence(part, 0, 0, false) + 3);
  // Nothing is seen of the third.
  EXPECT_LT(Evidence(unseen), Evidence(part) - 3);
  EXPECT_DOUBLE_EQ(Evidence(unseen, 0, 0, false), Evidence(part, 0, 0, false));
}

TEST(PartialEvidence, WhatIsNotAlikeOrGoesOnIsLessInALitRoom) {
  WandCandidate part, goes_on;
  goes_on.partial_around = 0.1;
  EXPECT_LT(Evidence(part, 0.08), Evidence(part) - 5);
  EXPECT_LT(Evidence(goes_on), Evidence(part) - 3);
  EXPECT_LT(Evidence(part, 0.02, 4), Evidence(part) - 2);
  EXPECT_DOUBLE_EQ(Evidence(goes_on, 0.08, 4, false), Evidence(part, 0, 0, false));
}

// It costs that already, but says little: the place of a part is vague.
TEST(PartialEvidence, PoseAndSizesCountLess) {
  WandCandidate part, sizes;
  sizes.partial_size_cost = 4;
  EXPECT_NEAR(Evidence(sizes), Evidence(part) + 0.7 * 4, 1e-9);
  VerifiedWand tilted = Wand(0.02);
  tilted.fit.cost = 2;
  tilted.fit.tilt_rad = 1;
  EXPECT_NEAR(PartialEvidence(part, tilted, 0, true), Evidence(part) + 0.7 * (2 + TiltCost(1)),
              1e-9);
  sizes.partial_size_cost = 1000;  // but not at any cost
  EXPECT_LT(Evidence(sizes), Evidence(part) + 10);
}

TEST(SaysWhichMarkers, APieceOfAStickAlongTheLineOfSightDoesNot) {
  WandCandidate middle, end;
  middle.partial = 1;
  middle.has_stick = end.has_stick = true;
  end.partial = 2;
  VerifiedWand wand = Wand(0);
  wand.fit.tilt_rad = -1.3;
  EXPECT_FALSE(SaysWhichMarkers(middle, wand));
  EXPECT_TRUE(SaysWhichMarkers(end, wand));
  wand.fit.tilt_rad = -1.2;
  EXPECT_TRUE(SaysWhichMarkers(middle, wand));
}

TEST(SaysWhichMarkers, AThinRimDoesWhereAllElseFits) {
  WandCandidate thin;
  thin.partial = 0;
  thin.is_sliver = true;
  thin.partial_share = 0.03;
  thin.partial_cost = 4;
  VerifiedWand wand = Wand(0);
  EXPECT_TRUE(SaysWhichMarkers(thin, wand));
  wand.fit.cost = 4;
  EXPECT_FALSE(SaysWhichMarkers(thin, wand));
  thin.partial_share = 0.06;
  EXPECT_TRUE(SaysWhichMarkers(thin, wand));
  thin.partial_share = 0.03;
  thin.has_stick = true;
  EXPECT_TRUE(SaysWhichMarkers(thin, wand));
}

// Labels are nearly as round as spheres, but not quite.
TEST(FlippedCost, OfHardlyARimIsMoreThanOfWhatIsSeenAsMuch) {
  VerifiedWand much, rim, whole;
  much.has_part = rim.has_part = true;
  much.part_share = 0.4;
  rim.part_share = 0.03;
  much.cost = 5.5;
  rim.cost = whole.cost = 6.5;
  EXPECT_GT(FlippedCost(much, rim), rim.cost + 1);
  EXPECT_DOUBLE_EQ(FlippedCost(rim, much), much.cost);
  EXPECT_DOUBLE_EQ(FlippedCost(much, whole), whole.cost);
  rim.part_share = 0.3;
  EXPECT_DOUBLE_EQ(FlippedCost(much, rim), rim.cost);
}

TEST(OutlineEvidence, WhatFitsWorseIsLess) {
  const OutlineMatch good{0.55, 0}, rough{0.7, 0}, off{0.55, 0.0625}, none;
  const double both = OutlineEvidence({good, good});
  EXPECT_GT(both, 12);
  EXPECT_LT(OutlineEvidence({good, rough}), both - 5);
  EXPECT_LT(OutlineEvidence({rough, rough}), both - 10);
  EXPECT_LT(OutlineEvidence({off, good}), both - 2);
  EXPECT_LT(OutlineEvidence({good, none}), both - 9);
  // No outline of the simulation fits better; and the worst says only so much.
  EXPECT_DOUBLE_EQ(OutlineEvidence({{0.4, 0}, {0.5, 0}}), OutlineEvidence({{0.5, 0}, {0.5, 0}}));
  EXPECT_DOUBLE_EQ(OutlineEvidence({{5, 1}, {5, 1}}), OutlineEvidence({{1, 0.25}, {1, 0}}));
}

TEST(ColourEvidence, IsLessOfMarkersOfDifferentColours) {
  EXPECT_DOUBLE_EQ(ColourEvidence(Wand(0.06)), 0);
  EXPECT_LT(ColourEvidence(Wand(0.08)), -1.5);
  EXPECT_LT(ColourEvidence(Wand(0.1)), -4);
  EXPECT_GT(ColourEvidence(Wand(0.5)), -6);
  VerifiedWand clipped = Wand(0.1);
  clipped.centres[0].plateau_grey.x() = 250;
  EXPECT_DOUBLE_EQ(ColourEvidence(clipped), 0);
  VerifiedWand other = Wand(0.2);
  other.centres[0].plateau_grey *= 1.25;
  EXPECT_LT(ColourEvidence(other), -4);
}

TEST(WholeOutlineEvidence, IsLessOfThreeThatAllFitBadly) {
  const OutlineMatch good{0.55, 0}, rough{0.75, 0.05}, none;
  EXPECT_DOUBLE_EQ(WholeOutlineEvidence({good, good, good}), 0);
  EXPECT_DOUBLE_EQ(WholeOutlineEvidence({good, good, rough}), 0);  // one may be before a window
  EXPECT_LT(WholeOutlineEvidence({rough, rough, rough}), -3);
  EXPECT_LT(WholeOutlineEvidence({none, none, good}), -1.5);
}

}  // namespace
}  // namespace rigcal::agent::partial_evidence_test
