// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

#include "common/camera/intrinsics.h"
#include "common/target/target.h"
#include "tests/testing/wand_motion.h"

namespace rigcal::accuracy {

using ::rigcal::testing::WandMotion;

struct RandomWandPoseOptions {
  double min_distance_m = 1.5;  // of every marker from the camera
  double max_distance_m = 6;
  double margin_px = 3;            // between every sphere's image and the image's border
  double max_tilt_deg = 70;        // of the wand out of the plane across the line of sight
  double speed_m_s = 0;            // of the middle, in a random direction
  double angular_speed_rad_s = 0;  // about a random axis across the wand
};

// A wand fully visible anywhere in the image, its distance spread evenly over the range: no
// sphere's image touches the border or another one's. Follows from `seed` alone. None: after many
// tries no such pose was found (the wand is too long for this lens).
std::optional<WandMotion> RandomWandPose(const Intrinsics& intrinsics, const ImageSize& image_size,
                                         const Target& target, const RandomWandPoseOptions& options,
                                         uint64_t seed);

}  // namespace rigcal::accuracy
