// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "absl/types/span.h"
#include "agent/detect/frame/spot_finder.h"
#include "agent/identify/wand_finder.h"

namespace rigcal::agent {

// Returns how unlike the middles of a candidate's markers are in brightness and colour, as a
// chi-squared. The candidate's blobs are indices of `spots`.
double Unlikeness(absl::Span<const Spot> spots, const WandCandidate& candidate);

}  // namespace rigcal::agent
