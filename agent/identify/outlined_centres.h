// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "absl/container/inlined_vector.h"
#include "agent/identify/outline_rows.h"
#include "agent/identify/sphere_outline_fit.h"
#include "agent/identify/verified_wand.h"
#include "agent/identify/wand_mechanisms.h"

namespace rigcal::agent {

// By marker; null where the outline cannot be fitted.
struct OutlinedMarker {
  const SphereOutline* outline = nullptr;              // with any slope of the light
  OutlinePixels* pixels = nullptr;                     // changed: MarkStick, CountUnsure
  Eigen::Vector2d moved_px = Eigen::Vector2d::Zero();  // MeasuredMarker::moved_px
};
using OutlinedMarkers = absl::InlinedVector<OutlinedMarker, 3>;

// Takes the centres of a chosen wand's whole markers from their outlines, with covariances.
//
// How strongly light from one side may shade the spheres is learned from the spheres themselves:
// tau^2, the variance of the relative slopes of brightness that is left when what noise alone gives
// is taken away, plus a share of that noise, because few slopes do not tell it well. It is the
// prior of the slopes in the last fit. So in even light slopes cost no precision, in uneven light
// they do not move the centre, and where blur hides them the covariance says so. Whether it is
// white light that shades them or their own that is uneven, which behind a mosaic differs from
// pixel to pixel, is what fits better.
void SetOutlinedCentres(const OutlinedMarkers& markers, SphereOutlineFitter* fitter,
                        VerifiedWand* wand, const WandMechanisms& without = {});

}  // namespace rigcal::agent
