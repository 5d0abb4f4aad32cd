// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/solver/rig_comparison.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/camera/camera_model.h"
#include "common/statistics/robust_statistics.h"
#include "server/solve/geometry/triangulation.h"

namespace rigcal::accuracy {
namespace {

Eigen::Isometry3d FitRigid(const std::vector<Eigen::Vector3d>& from,
                           const std::vector<Eigen::Vector3d>& to) {
  const auto count = static_cast<Eigen::Index>(from.size());
  const Eigen::Map<const Eigen::Matrix3Xd> a(from.front().data(), 3, count);
  const Eigen::Map<const Eigen::Matrix3Xd> b(to.front().data(), 3, count);
  return Eigen::Isometry3d(Eigen::umeyama(a, b, false));
}

const ComparedRig::Camera* Find(const ComparedRig& rig, const std::string& name) {
  const auto found = std::ranges::find(rig.cameras, name, &ComparedRig::Camera::name);
  return found == rig.cameras.end() ? nullptr : &*found;
}

bool IsInImage(const ImageSize& size, const Eigen::Vector2d& pixel) {
  return pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() < size.width && pixel.y() < size.height;
}

}  // namespace

ComparedRig RigOf(const SimulatedWorld& world) {
  ComparedRig rig;
  for (const SimulatedCamera& camera : world.cameras()) {
    rig.cameras.push_back({camera.description.camera, camera.description.image_size_px,
                           camera.cam_from_rig, camera.true_intrinsics});
  }
  rig.target_length_m = world.true_target().marker_positions_m.back();
  return rig;
}

ComparedRig RigOf(const server::RunningEstimate& estimate) {
  ComparedRig rig;
  for (const server::EstimateStart::Camera& camera : estimate.next.cameras) {
    rig.cameras.push_back({camera.name, {}, camera.cam_from_rig, camera.intrinsics});
  }
  rig.target_length_m = estimate.marker_positions_m.back();
  return rig;
}

ComparedRig RigOf(const CalibrationResult& result) {
  ComparedRig rig;
  for (const CalibratedCamera& camera : result.cameras) {
    rig.cameras.push_back(
        {camera.camera, camera.image_size_px, camera.cam_from_rig, camera.intrinsics});
  }
  rig.target_length_m = result.target.marker_positions_m.back();
  return rig;
}

Eigen::Isometry3d Align(const ComparedRig& from, const ComparedRig& to) {
  std::vector<Eigen::Vector3d> from_m, to_m;
  for (const ComparedRig::Camera& camera : from.cameras) {
    const ComparedRig::Camera* const other = Find(to, camera.name);
    if (other == nullptr) continue;
    from_m.push_back(camera.cam_from_rig.SourceFromTargetTranslation());
    to_m.push_back(other->cam_from_rig.SourceFromTargetTranslation());
  }
  return FitRigid(from_m, to_m);
}

double TriangulationErrorM(const ComparedRig& truth, const ComparedRig& found,
                           const std::vector<Eigen::Vector3d>& points_m) {
  const double stretch = truth.target_length_m / found.target_length_m;
  std::vector<Eigen::Vector3d> placed_m, true_m;
  for (const Eigen::Vector3d& point_m : points_m) {
    std::vector<server::CameraRay> views;
    for (const ComparedRig::Camera& camera : truth.cameras) {
      Eigen::Vector2d pixel;
      if (!ImageOf(camera.intrinsics, camera.cam_from_rig * point_m, &pixel) ||
          !IsInImage(camera.image_size_px, pixel)) {
        continue;
      }
      const ComparedRig::Camera* const solved = Find(found, camera.name);
      if (solved == nullptr) continue;
      const auto ray = Undistort(solved->intrinsics, pixel);
      if (ray.ok()) views.push_back({solved->cam_from_rig, *ray});
    }
    const auto placed = server::Triangulate(views);
    if (!placed) continue;
    placed_m.push_back(stretch * *placed);
    true_m.push_back(point_m);
  }
  if (placed_m.size() < 4) return std::numeric_limits<double>::infinity();
  const Eigen::Isometry3d fit = FitRigid(placed_m, true_m);
  std::vector<double> errors_m;
  for (size_t i = 0; i < placed_m.size(); ++i) {
    errors_m.push_back((fit * placed_m[i] - true_m[i]).norm());
  }
  return UpperQuantile(&errors_m, 0.95);
}

std::vector<Eigen::Vector3d> PointsOf(const server::RunningEstimate& estimate,
                                      const ComparedRig& truth) {
  const Eigen::Isometry3d truth_from_estimate = Align(RigOf(estimate), truth);
  std::vector<Eigen::Vector3d> points_m;
  for (const size_t index : estimate.error.points) {
    points_m.push_back(truth_from_estimate * estimate.grid.Point(index));
  }
  return points_m;
}

}  // namespace rigcal::accuracy
