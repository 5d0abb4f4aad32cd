// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "absl/types/span.h"
#include "agent/identify/outline_rows.h"
#include "agent/identify/sphere_outline_fit.h"

namespace rigcal::agent {

// How far a sphere's edge scatters about its outline besides the noise of single pixels: the
// background behind it is not everywhere that of the ring, and neighbouring pixels share noise. The
// edge in a sector has the variance noise / information + extra_px2.
struct EdgeScatter {
  double noise = 1;      // factor of the variance that the pixels are said to have
  double extra_px2 = 0;  // of a usual sector

  double Of(double information) const { return noise / information + extra_px2; }
};

using SectorVariances = std::array<double, kOutlineParts>;

// Estimates the scatter of each outline from its own sectors and, because these are few, from those
// of all outlines. A null outline gets that of all.
std::vector<EdgeScatter> ScatterOfEdges(absl::Span<const SphereOutline* const> outlines);

// Returns the variances beyond noise, px^2: those of `scatter`, and more for sectors that are
// further away than it explains or have a saturated background. The stick's sides do not count,
// except in an arc, an outline that the image's border cuts.
SectorVariances ExtraVariances(const OutlinePixels& pixels, const SphereOutline& outline,
                               const EdgeScatter& scatter, bool is_arc = false);

// Copies `pixels`, with precisions that make each sector as precise as its variances say.
void Discount(const OutlinePixels& pixels, const SphereOutline& outline,
              const SectorVariances& extra_px2, double noise, OutlinePixels* discounted);

}  // namespace rigcal::agent
