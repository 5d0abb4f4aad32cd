// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "absl/types/span.h"
#include "agent/detect/frame/spot_finder.h"
#include "agent/identify/detection.h"
#include "agent/identify/wand_finder.h"
#include "common/target/target.h"

namespace rigcal::agent {

// How the wand in the picture differs from the one that the target describes.
struct OtherWand {
  // Distance of the middle sphere from the nearer end, over that of the ends; 0: as told.
  double middle_share = 0;
  // Size of the spheres' images for the wand's length, over what the target's diameter says; 0: as
  // it says, or the target has none.
  double size_ratio = 0;
};

// Looks for another wand among spots in which the target was not found: three in line that are
// alike in size, brightness and colour. Reports no difference if there are no such three, or
// several times three. Only for targets of three markers.
OtherWand FindOtherWand(absl::Span<const Spot> spots, const WandFinder& finder);

// Says how the wand of a detection differs from the target's, and what to check. Empty: no other
// wand was found.
std::string OtherWandText(const Detection& detection, const Target& target);

}  // namespace rigcal::agent
