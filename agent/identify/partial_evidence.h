// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "absl/types/span.h"
#include "agent/identify/verified_wand.h"
#include "agent/identify/wand_finder.h"

namespace rigcal::agent {

// How much more (or less) often two things and a part of a third are a wand than the cost says that
// chooses among them, as a chi-squared: by logistic regression on pictures of both simulations,
// with a wand and without. `unresolved`: the cost of two spheres that look like any two small
// things. `in_room`: of a lit room, in which there are such things.
double PartialEvidence(const WandCandidate& candidate, const VerifiedWand& wand, double unresolved,
                       bool in_room);

// Whether what is seen of the part says which markers the other two are, in a lit room. Of a wand
// that points at the camera the stick between two markers is taken for the middle one; and a thin
// rim without a stick may be that of something else, where pose and sizes do not fit well.
bool SaysWhichMarkers(const WandCandidate& candidate, const VerifiedWand& wand);

// The cost of the same two spheres the other way round, as a rival of `wand`: a good deal of a
// third sphere is hardly there by chance, but a mere rim on the other side may be.
double FlippedCost(const VerifiedWand& wand, const VerifiedWand& flipped);

// How well the outline of a sphere fits; none can be fitted: badly.
struct OutlineMatch {
  double misfit = 1;       // the residual over what noise and shading may leave (ShapeCost)
  double off_outline = 0;  // see SphereOutline
};

// What the outlines of the two add to that in a lit room: labels, lamps and what is seen between
// slats are hardly ever spheres as exactly, or stand out less.
double OutlineEvidence(absl::Span<const OutlineMatch> outlines);

// What the colours of a wand of which all markers were measured add in a lit room, at most 0: its
// LEDs are of one colour, within 0.067 rad for 99.5 % of rendered wands; labels of books are not.
// Clipped channels say less.
double ColourEvidence(const VerifiedWand& wand);

// What the outlines add of a wand of which no marker is hidden, at most 0.
double WholeOutlineEvidence(absl::Span<const OutlineMatch> outlines);

}  // namespace rigcal::agent
