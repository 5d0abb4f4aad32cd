// SPDX-License-Identifier: Apache-2.0
#include "client/results/true_point_error.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <utility>
#include <vector>

#include "common/statistics/robust_statistics.h"
#include "common/triangulate/point_fit.h"

namespace rigcal::client {
namespace {

constexpr int kTimes = 300;
constexpr size_t kMinPoints = 30;

// Index in the calibration, and the camera as it truly is.
using TrueCameras = std::vector<std::pair<int, const SimulatedCamera*>>;

TrueCameras MatchCameras(const CalibrationResult& calibration, const SimulatedWorld& world) {
  TrueCameras cameras;
  for (const SimulatedCamera& truth : world.cameras()) {
    const auto found =
        std::ranges::find(calibration.cameras, truth.description.camera, &CalibratedCamera::camera);
    if (found == calibration.cameras.end()) continue;
    cameras.emplace_back(static_cast<int>(found - calibration.cameras.begin()), &truth);
  }
  return cameras;
}

std::vector<PixelView> ImagesOf(const Eigen::Vector3d& point_m, const TrueCameras& cameras) {
  std::vector<PixelView> views;
  for (const auto& [index, camera] : cameras) {
    PixelView view;
    view.camera = index;
    const ImageSize& size = camera->description.image_size_px;
    if (ImageOf(camera->true_intrinsics, camera->cam_from_rig * point_m, &view.centre_px) &&
        view.centre_px.x() >= 0 && view.centre_px.y() >= 0 && view.centre_px.x() < size.width &&
        view.centre_px.y() < size.height) {
      views.push_back(view);
    }
  }
  return views;
}

}  // namespace

std::optional<double> TruePointErrorM(const CalibrationResult& calibration,
                                      const SimulatedWorld& world) {
  const Target& target = world.true_target();
  if (!calibration.scale_known || !target.IsLine() ||
      calibration.target.marker_positions_m.empty() ||
      !(calibration.target.marker_positions_m.back() > 0)) {
    return std::nullopt;
  }
  const double stretch =
      target.marker_positions_m.back() / calibration.target.marker_positions_m.back();
  const TrueCameras cameras = MatchCameras(calibration, world);
  std::vector<Eigen::Vector3d> placed_m, true_m;
  for (int i = 0; i < kTimes; ++i) {
    const WandPose wand = world.WandAt(world.options().duration_s * (i + 0.5) / kTimes);
    for (int m = 0; m < target.marker_count(); ++m) {
      const Eigen::Vector3d point_m = world.MarkerAt(wand, static_cast<size_t>(m));
      const auto point = FitPoint(calibration.cameras, ImagesOf(point_m, cameras));
      if (!point) continue;
      placed_m.push_back(stretch * point->position_m);
      true_m.push_back(point_m);
    }
  }
  if (placed_m.size() < kMinPoints) return std::nullopt;
  const auto count = static_cast<Eigen::Index>(placed_m.size());
  const Eigen::Isometry3d true_from_placed(
      Eigen::umeyama(Eigen::Map<const Eigen::Matrix3Xd>(placed_m.front().data(), 3, count),
                     Eigen::Map<const Eigen::Matrix3Xd>(true_m.front().data(), 3, count), false));
  std::vector<double> errors_m;
  for (size_t i = 0; i < placed_m.size(); ++i) {
    errors_m.push_back((true_from_placed * placed_m[i] - true_m[i]).norm());
  }
  return UpperQuantile(&errors_m, 0.95);
}

}  // namespace rigcal::client
