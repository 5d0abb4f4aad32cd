// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/wand_evidence.h"

#include <algorithm>
#include <cmath>

#include "agent/identify/squared.h"

namespace rigcal::agent {
namespace {

constexpr double kMeterNoise = 0.015;   // of a coverage, see MarkerMeter::CollectPixels
constexpr double kOutlineNoise = 0.03;  // what the model of an outline leaves besides
constexpr double kLikeColour = 0.03;    // one sigma of the difference of spheres, in rad
constexpr double kLikeClippedColour = 0.06;
constexpr double kClippedGrey = 235;
constexpr double kFreeColour = 5;  // of the cost, by noise and surroundings
constexpr double kMostColourCost = 5;
// Per unit of the outlines' misfits above the usual one and of the sectors off the outline.
constexpr double kMisfitCost = 10, kOffOutline = 0.85;
constexpr double kUsualMisfit = 0.5, kMostOfOne = 0.3;  // of one outline
constexpr double kUsualSum = 0.45;                      // of all

}  // namespace

double Misfit(const MarkerCentre& centre, const SphereOutline& outline) {
  const double noise = centre.noise_grey / centre.contrast_grey;
  return outline.residual * std::hypot(noise, kMeterNoise) / std::hypot(noise, kOutlineNoise);
}

double ColourCost(const VerifiedWand& wand) {
  const bool is_clipped = std::ranges::any_of(wand.centres, [](const MarkerCentre& centre) {
    return centre.plateau_grey.maxCoeff() > kClippedGrey;
  });
  const double sigma = is_clipped ? kLikeClippedColour : kLikeColour;
  return std::clamp(Squared(ColourDifference(wand) / sigma) - kFreeColour, 0.0, kMostColourCost);
}

double WholeOutlineCost(absl::Span<const OutlineMatch> outlines) {
  double sum = 0;
  for (const OutlineMatch& outline : outlines) {
    sum += std::clamp(outline.misfit - kUsualMisfit, 0.0, kMostOfOne) +
           kOffOutline * outline.off_outline;
  }
  return kMisfitCost * std::max(0.0, sum - kUsualSum);
}

}  // namespace rigcal::agent
