// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "absl/types/span.h"
#include "agent/identify/sphere_outline_fit.h"
#include "agent/identify/verified_wand.h"

namespace rigcal::agent {

// What an outline's fit leaves, over what noise and shading may leave.
double Misfit(const MarkerCentre& centre, const SphereOutline& outline);

// How well the outline of a sphere fits; none can be fitted: badly.
struct OutlineMatch {
  double misfit = 1;       // Misfit
  double off_outline = 0;  // see SphereOutline
};

// What the colours of a wand cost in a lit room, as a chi-squared: its LEDs are of one colour,
// within 0.067 rad for 99.5 % of rendered wands; labels of books are not. Clipped channels say
// less.
double ColourCost(const VerifiedWand& wand);

// What outlines cost that all fit badly.
double WholeOutlineCost(absl::Span<const OutlineMatch> outlines);

}  // namespace rigcal::agent
