// SPDX-License-Identifier: Apache-2.0
#include "tests/testing/wand_motion.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "common/camera/camera_model.h"
#include "common/simulation/frames/light_model.h"
#include "common/simulation/frames/scene_ground_truth.h"

namespace rigcal::testing {
namespace {

constexpr int kDiscSamples = 400;
constexpr double kMinShare = 0.98;

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

bool IsInside(const ImageSize& image_size, const Eigen::Vector2d& pixel) {
  return pixel.x() >= -0.5 && pixel.x() < image_size.width - 0.5 && pixel.y() >= -0.5 &&
         pixel.y() < image_size.height - 0.5;
}

}  // namespace

SphereMotion WandMotion::Marker(double position_m) const {
  const Eigen::Vector3d turning = angular_velocity_rad_s.cross(position_m * direction);
  return {At(position_m), velocity_m_s + turning, angular_velocity_rad_s.cross(turning)};
}

std::vector<SphereMotion> WandMotion::Spheres(const Target& target) const {
  std::vector<SphereMotion> spheres;
  for (const double position_m : target.marker_positions_m) spheres.push_back(Marker(position_m));
  return spheres;
}

double VisibleShare(const Intrinsics& intrinsics, const ImageSize& image_size, const Target& target,
                    const WandPose& wand, size_t marker, const OccludingBar* bar) {
  const double radius_m = SphereRadiusM(target);
  const Eigen::Vector3d centre = wand.At(target.marker_positions_m[marker]);
  Eigen::Vector2d pixel;
  if (!(centre.norm() > radius_m) || !ImageOf(intrinsics, centre, &pixel)) return 0;
  int seen = 0;
  for (int sample = 0; sample < kDiscSamples; ++sample) {
    const Eigen::Vector3d ray = DiscRay(centre, radius_m, sample);
    if (!Project(intrinsics, ray, &pixel) || !IsInside(image_size, pixel)) continue;
    if (bar != nullptr && bar->InsidePx(pixel) > 0) continue;
    const bool hidden = std::ranges::any_of(target.marker_positions_m, [&](double position_m) {
      const Eigen::Vector3d other = wand.At(position_m);
      return other.norm() < centre.norm() && other.dot(ray) > 0 &&
             other.cross(ray).norm() < radius_m;
    });
    seen += hidden ? 0 : 1;
  }
  return static_cast<double>(seen) / kDiscSamples;
}

bool WandVisible(const Intrinsics& intrinsics, const ImageSize& image_size, const Target& target,
                 const WandPose& wand, const OccludingBar* bar) {
  for (size_t m = 0; m < target.marker_positions_m.size(); ++m) {
    const Eigen::Vector3d centre = wand.At(target.marker_positions_m[m]);
    if (!TruthOf(intrinsics, image_size, centre, SphereRadiusM(target)).inside) return false;
    if (VisibleShare(intrinsics, image_size, target, wand, m, bar) < kMinShare) return false;
  }
  return true;
}

}  // namespace rigcal::testing
