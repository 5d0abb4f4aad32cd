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

// What the outlines of a wand's spheres say of one another, and the pose of each. The spheres are
// of one size, equally out of focus and, but for perspective, of one shape.

// By marker; none where the marker has no outline.
using FittedOutlines = absl::InlinedVector<std::optional<SphereOutline>, 3>;

// Of EdgeRatio, from which on an outline may be that of a sphere that is partly hidden.
inline constexpr double kSuspectRatio = 3;

// Of the pixels' residuals, as a ratio of variances, at least 1.
double ScatterOf(const SphereOutline& outline);
std::vector<EdgeScatter> ScatterOf(const FittedOutlines& outlines);

// With their distances the middle one of three says how large each outline is and how soft. What
// hides a part of a sphere makes it smaller, what is beside it larger and softer.
OutlineExpectation ExpectationOf(const VerifiedWand& wand, const FittedOutlines& outlines,
                                 size_t marker);

// How much less the edge is on its outline than those of the others, as a ratio of variances.
double EdgeRatio(const FittedOutlines& outlines, size_t marker);

// How many pixels smaller than expected an outline is whose edge is less on it than the others'; 0
// where its edge is on it.
double MissingRadius(const FittedOutlines& outlines, size_t marker,
                     const OutlineExpectation& expected);

// How far off the place of an outline may be, px, that is longer than the others': what hides a
// side of a sphere makes it so.
double WrongByStretch(const FittedOutlines& outlines, size_t marker);

// The same of one that cannot be quite that of a sphere: one that is much smaller than pose and
// diameter say, or whose light would be less than none on one side.
double WrongOutline(const VerifiedWand& wand, size_t marker, const SphereOutline& outline);

// So much of the sphere is hidden that its outline does not tell its centre.
bool IsPartlyHidden(const VerifiedWand& wand, const FittedOutlines& outlines, size_t marker,
                    const OutlineExpectation& expected, const OutlinePixels& pixels);

}  // namespace rigcal::agent
