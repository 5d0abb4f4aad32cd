// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "absl/container/inlined_vector.h"
#include "agent/identify/outline_rows.h"
#include "agent/identify/outline_sectors.h"
#include "agent/identify/sphere_outline_fit.h"
#include "agent/identify/verified_wand.h"

namespace rigcal::agent {

// Compares the outlines of a wand's spheres with each other and with its pose. The spheres have one
// size and, but for perspective, one shape, and are equally out of focus.

// By marker; none if the marker has no outline.
using FittedOutlines = absl::InlinedVector<std::optional<SphereOutline>, 3>;

// From this EdgeRatio on an outline may be that of a sphere that is partly hidden.
inline constexpr double kSuspectRatio = 3;

// Scatter of the pixels' residuals over that of noise, as a ratio of variances, at least 1.
double ScatterOf(const SphereOutline& outline);
std::vector<EdgeScatter> ScatterOf(const FittedOutlines& outlines);

// Predicts size and softness of an outline from the median of all and their distances. What hides a
// part of a sphere makes its outline smaller, what is beside it larger and softer.
OutlineExpectation ExpectationOf(const VerifiedWand& wand, const FittedOutlines& outlines,
                                 size_t marker);

// Returns how much more an edge scatters about its outline than the others', a ratio of variances.
double EdgeRatio(const FittedOutlines& outlines, size_t marker);

// By how many pixels an outline is too small, if its edge scatters more than the others'; else 0.
double MissingRadius(const FittedOutlines& outlines, size_t marker,
                     const OutlineExpectation& expected);

// Returns how wrong the place of an outline may be, px, because it is longer than the others: what
// hides a side of a sphere makes it so.
double WrongByStretch(const FittedOutlines& outlines, size_t marker);

// The same for an outline that is not quite a sphere's: it is much smaller than pose and diameter
// say, or its light would be negative on one side.
double WrongOutline(const VerifiedWand& wand, size_t marker, const SphereOutline& outline);

// Tells whether so much of a sphere is hidden that its outline does not show its centre.
bool IsPartlyHidden(const VerifiedWand& wand, const FittedOutlines& outlines, size_t marker,
                    const OutlineExpectation& expected, const OutlinePixels& pixels);

}  // namespace rigcal::agent
