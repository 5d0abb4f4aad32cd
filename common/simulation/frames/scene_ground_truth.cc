// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/frames/scene_ground_truth.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>

#include "common/camera/camera_model.h"

namespace rigcal {
namespace {

constexpr int kDiscSamples = 400;

// Rays spread evenly over a sphere's disc: on a sunflower's spiral.
Eigen::Vector3d DiscRay(const Eigen::Vector3d& centre_in_cam, double radius_m, int sample) {
  const Eigen::Vector3d axis = centre_in_cam.normalized();
  const Eigen::Vector3d across = axis.unitOrthogonal();
  const double sine_of_rim = radius_m / centre_in_cam.norm();
  const double sine = sine_of_rim * std::sqrt((sample + 0.5) / kDiscSamples);
  const double turn = sample * std::numbers::pi * (3 - std::sqrt(5.0));
  return std::sqrt(1 - sine * sine) * axis +
         sine * (std::cos(turn) * across + std::sin(turn) * axis.cross(across));
}

// Whether a sphere nearer than the one looked at stands in the way of a ray.
bool Hidden(std::span<const SphereMotion> spheres, size_t marker, double radius_m,
            const Eigen::Vector3d& ray) {
  const double own_distance = spheres[marker].centre_m.norm();
  for (size_t other = 0; other < spheres.size(); ++other) {
    const Eigen::Vector3d& centre = spheres[other].centre_m;
    if (other == marker || centre.norm() >= own_distance) continue;
    if (centre.dot(ray) > 0 && centre.cross(ray).norm() < radius_m) return true;
  }
  return false;
}

}  // namespace

bool ImageOf(const Intrinsics& intrinsics, const Eigen::Vector3d& x_in_cam,
             Eigen::Vector2d* pixel) {
  if (!Project(intrinsics, x_in_cam, pixel)) return false;
  const auto direction = Undistort(intrinsics, *pixel);
  return direction.ok() && (*direction - x_in_cam.hnormalized()).norm() < 1e-6;
}

bool IsInside(const ImageSize& image_size, const Eigen::Vector2d& pixel) {
  return pixel.x() >= -0.5 && pixel.x() < image_size.width - 0.5 && pixel.y() >= -0.5 &&
         pixel.y() < image_size.height - 0.5;
}

std::vector<MarkerGroundTruth> TruthOf(const Intrinsics& intrinsics, const ImageSize& image_size,
                                       std::span<const SphereMotion> spheres, double radius_m,
                                       const OccludingBar* bar) {
  std::vector<MarkerGroundTruth> markers(spheres.size());
  for (size_t m = 0; m < spheres.size(); ++m) {
    const Eigen::Vector3d& centre = spheres[m].centre_m;
    MarkerGroundTruth& truth = markers[m];
    truth.distance_m = centre.norm();
    truth.projects = truth.distance_m > radius_m && ImageOf(intrinsics, centre, &truth.centre_px);
    if (!truth.projects) continue;
    truth.inside = IsInside(image_size, truth.centre_px);
    int seen = 0, on_rim = 0;
    for (int sample = 0; sample < kDiscSamples; ++sample) {
      const Eigen::Vector3d ray = DiscRay(centre, radius_m, sample);
      Eigen::Vector2d pixel;
      if (!Project(intrinsics, ray, &pixel)) continue;
      // The outermost samples lie all round, next to the outline.
      if (sample >= kDiscSamples - 20) {
        truth.radius_px += (pixel - truth.centre_px).norm();
        ++on_rim;
      }
      if (!IsInside(image_size, pixel) || (bar != nullptr && bar->InsidePx(pixel) > 0)) continue;
      if (!Hidden(spheres, m, radius_m, ray)) ++seen;
    }
    if (on_rim > 0) truth.radius_px /= on_rim;
    truth.visible_share = static_cast<double>(seen) / kDiscSamples;
  }
  return markers;
}

}  // namespace rigcal
