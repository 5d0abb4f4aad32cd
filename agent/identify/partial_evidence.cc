// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/partial_evidence.h"

#include <algorithm>
#include <cmath>

#include "agent/identify/squared.h"

namespace rigcal::agent {
namespace {

// Of what the cost says of the pose: the place of a part is vague.
constexpr double kPoseEvidence = 0.7, kMostPoseEvidence = 6;
constexpr double kStickEvidence = 6;  // that is seen between the others
// Of a sliver, that is a mixture of their colour and what is around: a rim of something is one,
// too.
constexpr double kSliverEvidence = 1, kDarkSliverEvidence = 8;
// Against a wand of whose third nothing is seen that is as bright: a thing that covers the stick
// there, or a darker blob.
constexpr double kUnseenEvidence = 6;
constexpr double kDarkEvidence = -1, kRoomEvidence = 0.7;  // without what follows
constexpr double kLikeColour = 0.03;    // one sigma of the difference of spheres, in rad
constexpr double kAroundEvidence = 50;  // per share of the ring around the part that looks like it
constexpr double kUnresolvedEvidence = 0.6;
// Of the two outlines, less what does not fit: per unit of the misfit of each, above what noise and
// the model's limits leave, and of the sectors off the outline.
constexpr double kOutlineEvidence = 17, kMisfitEvidence = 40, kOffOutlineEvidence = 34;
// The same of all three of a whole wand, which has more to say for it.
constexpr double kWholeMisfitEvidence = 10, kUsualSum = 0.45;
// Of the colours of a whole one, beyond what noise and surroundings make.
constexpr double kFreeColour = 5, kMostColourEvidence = 5, kClippedGrey = 235,
                 kLikeClippedColour = 0.06;
constexpr double kMostMiddleTilt = 1.25, kThinShare = 0.05, kMostThinCost = 7;
constexpr double kMuchOfPart = 0.25, kLittleOfPart = 0.1, kLittleCost = 2;
constexpr double kUsualMisfit = 0.5, kMostPartMisfit = 0.3, kMostOffShare = 0.25;

struct MisfitSums {
  double misfit = 0, off = 0;
};

MisfitSums SumsOf(absl::Span<const OutlineMatch> outlines) {
  MisfitSums sums;
  for (const OutlineMatch& outline : outlines) {
    sums.misfit += std::clamp(outline.misfit - kUsualMisfit, 0.0, kMostPartMisfit);
    sums.off += outline.off_outline;
  }
  return sums;
}

}  // namespace

double PartialEvidence(const WandCandidate& candidate, const VerifiedWand& wand, double unresolved,
                       bool in_room) {
  const double pose_cost =
      wand.fit.cost + TiltCost(wand.fit.tilt_rad) + candidate.partial_size_cost;
  double evidence = kPoseEvidence * pose_cost;
  if (in_room) evidence = std::min(kMostPoseEvidence, evidence);
  if (candidate.has_stick) evidence += kStickEvidence;
  if (candidate.is_sliver) evidence += in_room ? kSliverEvidence : kDarkSliverEvidence;
  if (!in_room) return evidence + kDarkEvidence;
  if (!candidate.is_sliver && !(candidate.partial_share > 0)) evidence -= kUnseenEvidence;
  return evidence + kRoomEvidence - Squared(ColourDifference(wand) / kLikeColour) -
         kAroundEvidence * candidate.partial_around - kUnresolvedEvidence * unresolved;
}

bool SaysWhichMarkers(const WandCandidate& candidate, const VerifiedWand& wand) {
  if (!candidate.is_sliver) {
    return candidate.partial != 1 || std::abs(wand.fit.tilt_rad) < kMostMiddleTilt;
  }
  const double cost = wand.fit.cost + TiltCost(wand.fit.tilt_rad) + candidate.partial_cost;
  return candidate.has_stick || candidate.partial_share > kThinShare || cost < kMostThinCost;
}

double FlippedCost(const VerifiedWand& wand, const VerifiedWand& flipped) {
  const bool is_by_little =
      wand.part_share > kMuchOfPart && flipped.has_part && flipped.part_share < kLittleOfPart;
  return flipped.cost + (is_by_little ? kLittleCost : 0);
}

double OutlineEvidence(absl::Span<const OutlineMatch> outlines) {
  const auto [misfit, off] = SumsOf(outlines);
  return kOutlineEvidence - kMisfitEvidence * misfit -
         kOffOutlineEvidence * std::min(kMostOffShare, off);
}

double ColourEvidence(const VerifiedWand& wand) {
  const bool is_clipped = std::ranges::any_of(wand.centres, [](const MarkerCentre& centre) {
    return centre.plateau_grey.maxCoeff() > kClippedGrey;
  });
  const double sigma = is_clipped ? kLikeClippedColour : kLikeColour;
  const double cost = Squared(ColourDifference(wand) / sigma) - kFreeColour;
  return -std::clamp(cost, 0.0, kMostColourEvidence);
}

double WholeOutlineEvidence(absl::Span<const OutlineMatch> outlines) {
  const auto [misfit, off] = SumsOf(outlines);
  return -kWholeMisfitEvidence *
         std::max(0.0, misfit + kOffOutlineEvidence / kMisfitEvidence * off - kUsualSum);
}

}  // namespace rigcal::agent
