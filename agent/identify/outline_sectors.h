// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "absl/types/span.h"
#include "agent/identify/outline_rows.h"
#include "agent/identify/sphere_outline_fit.h"

namespace rigcal::agent {

// How far the edge of a sphere is from its outline besides the noise of the pixels: what is behind
// it is not everywhere what it is a little further outside, and noise is shared by neighbouring
// pixels. A sector of the edge has the variance noise / information + extra_px2.
struct EdgeScatter {
  double noise = 1;      // of the variance that the pixels are said to have
  double extra_px2 = 0;  // of a usual sector

  double Of(double information) const { return noise / information + extra_px2; }
};

using SectorVariances = std::array<double, kOutlineParts>;

// Of each outline (null: none), by its own sectors and, because these are few, by those of all.
std::vector<EdgeScatter> ScatterOfEdges(absl::Span<const SphereOutline* const> outlines);

// Variances beyond the noise, px^2: those of `scatter`, more of sectors that are further away than
// it explains, and of those whose background is saturated; the stick's sides do not count but for
// an arc.
SectorVariances ExtraVariances(const OutlinePixels& pixels, const SphereOutline& outline,
                               const EdgeScatter& scatter, bool is_arc = false);

// `pixels` with precisions that make each sector as precise as its variances say, over the noise.
void Discount(const OutlinePixels& pixels, const SphereOutline& outline,
              const SectorVariances& extra_px2, double noise, OutlinePixels* discounted);

}  // namespace rigcal::agent
