// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "absl/types/span.h"
#include "agent/detect/frame/spot_finder.h"
#include "agent/identify/wand_finder.h"

namespace rigcal::agent {

// Whether spots in which the target was not found show a wand of another spacing: three that are
// alike in size, brightness and colour, and in line. Where the middle one is between the others,
// 0 to 0.5 of their distance; none where there are no such three, more than three, or they are
// spaced as the target says. Of targets of three markers.
std::optional<double> OtherSpacing(absl::Span<const Spot> spots, const WandFinder& finder);

}  // namespace rigcal::agent
