// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "absl/container/inlined_vector.h"
#include "agent/identify/outline_rows.h"
#include "agent/identify/sphere_outline_fit.h"
#include "agent/identify/verified_wand.h"
#include "agent/identify/wand_mechanisms.h"

namespace rigcal::agent {

// One marker; null if the outline cannot be fitted.
struct OutlinedMarker {
  const SphereOutline* outline = nullptr;  // fitted with any slope of the light
  OutlinePixels* pixels = nullptr;         // changed by MarkStick
};
using OutlinedMarkers = absl::InlinedVector<OutlinedMarker, 3>;

// Sets the centres and covariances of a chosen wand's whole markers from their outlines.
//
// How strongly light from one side shades the spheres is learned from the spheres themselves: tau^2
// is the variance of the relative slopes of brightness beyond what noise alone gives, plus a share
// of that noise, because few slopes do not tell it well. It is the prior of the slopes in the last
// fit. So slopes cost no precision in even light, do not move the centre in uneven light, and enter
// the covariance where blur hides them. White light shades the spheres, or their own light is
// uneven, which behind a mosaic differs from pixel to pixel: what fits better is taken.
void SetOutlinedCentres(const OutlinedMarkers& markers, SphereOutlineFitter* fitter,
                        VerifiedWand* wand, const WandMechanisms& without = {});

}  // namespace rigcal::agent
