// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "common/camera/intrinsics.h"
#include "common/simulation/frames/occluding_bar.h"
#include "common/simulation/frames/scene_renderer.h"

namespace rigcal {

// The image of a point in frame `cam`. False where the lens has none: also beyond the part of the
// field in which its model is one to one, where a point would come back into the picture at a wrong
// place.
bool ImageOf(const Intrinsics& intrinsics, const Eigen::Vector3d& x_in_cam, Eigen::Vector2d* pixel);

bool IsInside(const ImageSize& image_size, const Eigen::Vector2d& pixel);

// What is true of each sphere at mid exposure. `bar` may be null.
std::vector<MarkerGroundTruth> TruthOf(const Intrinsics& intrinsics, const ImageSize& image_size,
                                       std::span<const SphereMotion> spheres, double radius_m,
                                       const OccludingBar* bar);

}  // namespace rigcal
