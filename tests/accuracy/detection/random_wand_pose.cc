// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/detection/random_wand_pose.h"

#include <Eigen/Geometry>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

#include "common/camera/camera_model.h"
#include "common/simulation/frames/light_model.h"
#include "common/simulation/frames/scene_ground_truth.h"
#include "common/simulation/world/random_stream.h"

namespace rigcal::accuracy {
namespace {

constexpr uint64_t kPosePurpose = 0x706f7365;
constexpr int kMaxTries = 2000;

Eigen::Vector3d RandomUnit(RandomStream* random) {
  const double z = random->Uniform(-1, 1), turn = random->Uniform(0, 2 * std::numbers::pi);
  const double across = std::sqrt(1 - z * z);
  return {across * std::cos(turn), across * std::sin(turn), z};
}

bool Fits(const Intrinsics& intrinsics, const ImageSize& image_size, const Target& target,
          const RandomWandPoseOptions& options, const WandMotion& wand) {
  std::vector<MarkerGroundTruth> truth;
  for (const double position_m : target.marker_positions_m) {
    const Eigen::Vector3d centre_m = wand.At(position_m);
    const double distance_m = centre_m.norm();
    if (distance_m < options.min_distance_m || distance_m > options.max_distance_m) return false;
    truth.push_back(TruthOf(intrinsics, image_size, centre_m, SphereRadiusM(target)));
  }
  for (size_t m = 0; m < truth.size(); ++m) {
    if (!truth[m].inside) return false;
    const double room_px = truth[m].radius_px + options.margin_px;
    const Eigen::Vector2d& centre = truth[m].centre_px;
    if (centre.x() < room_px || centre.x() > image_size.width - 1 - room_px ||
        centre.y() < room_px || centre.y() > image_size.height - 1 - room_px) {
      return false;
    }
    for (size_t other = 0; other < m; ++other) {
      const double apart_px = (truth[other].centre_px - centre).norm();
      if (apart_px < room_px + truth[other].radius_px) return false;
    }
  }
  return true;
}

}  // namespace

std::optional<WandMotion> RandomWandPose(const Intrinsics& intrinsics, const ImageSize& image_size,
                                         const Target& target, const RandomWandPoseOptions& options,
                                         uint64_t seed) {
  RandomStream random{seed, kPosePurpose};
  const double middle_m = 0.5 * target.marker_positions_m.back();
  // Drawn once: poses that do not fit must not make some distances rarer than others.
  const double distance_m = random.Uniform(options.min_distance_m, options.max_distance_m);
  for (int attempt = 0; attempt < kMaxTries; ++attempt) {
    const Eigen::Vector2d pixel(random.Uniform() * image_size.width,
                                random.Uniform() * image_size.height);
    const Eigen::Vector3d random_unit = RandomUnit(&random);
    const double tilt_rad = options.max_tilt_deg * std::numbers::pi / 180 * random.Uniform(-1, 1);
    const Eigen::Vector3d velocity = options.speed_m_s * RandomUnit(&random);
    const Eigen::Vector3d turn_axis = RandomUnit(&random);
    const auto ray = Undistort(intrinsics, pixel);
    if (!ray.ok()) continue;
    const Eigen::Vector3d sight = ray->homogeneous().normalized();
    const Eigen::Vector3d across = (random_unit - random_unit.dot(sight) * sight).normalized();
    WandMotion wand;
    wand.direction = std::cos(tilt_rad) * across + std::sin(tilt_rad) * sight;
    wand.origin_m = distance_m * sight - middle_m * wand.direction;
    wand.angular_velocity_rad_s =
        options.angular_speed_rad_s * turn_axis.cross(wand.direction).normalized();
    wand.velocity_m_s = velocity - wand.angular_velocity_rad_s.cross(middle_m * wand.direction);
    if (Fits(intrinsics, image_size, target, options, wand)) return wand;
  }
  return std::nullopt;
}

}  // namespace rigcal::accuracy
