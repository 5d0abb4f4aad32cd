// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/simulation/frames/scene_canvas.h"
#include "common/simulation/frames/sphere_image.h"
#include "common/simulation/world/simulated_world.h"
#include "common/target/target.h"

namespace rigcal::testing {

// The wand around the middle of an exposure, frame `cam`.
struct WandMotion : WandPose {
  WandMotion() : WandPose{Eigen::Vector3d::Zero(), Eigen::Vector3d::UnitX()} {}

  Eigen::Vector3d velocity_m_s = Eigen::Vector3d::Zero();  // of marker 0
  Eigen::Vector3d angular_velocity_rad_s = Eigen::Vector3d::Zero();

  SphereMotion Marker(double position_m) const;
  std::vector<SphereMotion> Spheres(const Target& target) const;
};

// 0 to 1: the share of a marker's projection that is within the image and hidden neither by a
// nearer sphere nor by the bar, which may be null.
double VisibleShare(const Intrinsics& intrinsics, const ImageSize& image_size, const Target& target,
                    const WandPose& wand, size_t marker, const OccludingBar* bar = nullptr);

// Every marker's centre in the image and nearly all of each to be seen.
bool WandVisible(const Intrinsics& intrinsics, const ImageSize& image_size, const Target& target,
                 const WandPose& wand, const OccludingBar* bar = nullptr);

}  // namespace rigcal::testing
