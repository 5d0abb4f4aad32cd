// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "absl/types/span.h"
#include "agent/detect/frame/spot_finder.h"
#include "agent/identify/wand_finder.h"

namespace rigcal::agent {

// How the wand in the picture differs from the one that the target describes.
struct OtherWand {
  // Where the middle sphere is between the others, 0 to 0.5 of their distance; 0: as the target
  // says.
  double middle_share = 0;
  // How large the spheres look for their distance, over what the target's diameter says; 0: as that
  // says, or the target has none.
  double size_ratio = 0;
};

// Looks for another wand among spots in which the target was not found: three that are alike in
// size, brightness and colour, and in line. Nothing differs where there are no such three, or more
// than three. Of targets of three markers.
OtherWand FindOtherWand(absl::Span<const Spot> spots, const WandFinder& finder);

}  // namespace rigcal::agent
