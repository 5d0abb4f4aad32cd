// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "absl/types/span.h"
#include "agent/identify/wand_finder.h"

namespace rigcal::agent {

// Wands of three markers of which one is mostly hidden: two whole blobs, and a third one where the
// hidden marker must be, that is a part of it. By cost; at most `max_candidates`.
//
// The first `whole_count` blobs can be whole markers, all of them parts of one. Two blobs alone say
// neither which markers they are nor which way the wand points: the part does, so there is none
// without it.
std::vector<WandCandidate> FindPartialWands(const WandFinder& finder, absl::Span<const Blob> blobs,
                                            size_t whole_count, size_t max_candidates);

// As a part of a marker is placed: within the marker. `radius_px`: of the whole marker.
void LoosenSight(double radius_px, MarkerSight* sight);

}  // namespace rigcal::agent
