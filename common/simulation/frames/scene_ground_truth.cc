// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/frames/scene_ground_truth.h"

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "common/camera/camera_model.h"
#include "common/simulation/world/simulated_world.h"

namespace rigcal {

MarkerGroundTruth TruthOf(const Intrinsics& intrinsics, const ImageSize& image_size,
                          const Eigen::Vector3d& centre_in_cam_m, double radius_m) {
  MarkerGroundTruth truth;
  const double distance_m = centre_in_cam_m.norm();
  if (!(distance_m > radius_m) || !ImageOf(intrinsics, centre_in_cam_m, &truth.centre_px)) {
    return truth;
  }
  const Eigen::Vector2d& centre_px = truth.centre_px;
  truth.inside = centre_px.x() >= -0.5 && centre_px.x() < image_size.width - 0.5 &&
                 centre_px.y() >= -0.5 && centre_px.y() < image_size.height - 0.5;
  // The outermost of 400 points spread evenly over the disc, on a sunflower's spiral.
  constexpr int kDiscSamples = 400, kRimSamples = 20;
  const Eigen::Vector3d axis = centre_in_cam_m.normalized();
  const Eigen::Vector3d across = axis.unitOrthogonal();
  int on_rim = 0;
  for (int sample = kDiscSamples - kRimSamples; sample < kDiscSamples; ++sample) {
    const double sine = radius_m / distance_m * std::sqrt((sample + 0.5) / kDiscSamples);
    const double turn = sample * std::numbers::pi * (3 - std::sqrt(5.0));
    Eigen::Vector2d pixel;
    if (!Project(intrinsics,
                 std::sqrt(1 - sine * sine) * axis +
                     sine * (std::cos(turn) * across + std::sin(turn) * axis.cross(across)),
                 &pixel)) {
      continue;
    }
    truth.radius_px += (pixel - centre_px).norm();
    ++on_rim;
  }
  if (on_rim > 0) truth.radius_px /= on_rim;
  return truth;
}

}  // namespace rigcal
