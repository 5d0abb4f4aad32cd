// SPDX-License-Identifier: Apache-2.0
#include "common/triangulate/convention_check.h"

#include <utility>

#include "absl/strings/str_format.h"

namespace rigcal {
namespace {

constexpr double kFewAgree = 0.3;
constexpr double kMostAgree = 0.7;
constexpr size_t kRowsTried = 400;  // of each camera

// Of the markers that two cameras saw, those that became a point.
double AgreeingShare(const Triangulation& triangulation) {
  const auto points = static_cast<double>(triangulation.points.size());
  const double all = points + triangulation.disagree_count + triangulation.no_ray_count;
  return all > 0 ? points / all : 1;
}

struct Convention {
  const char* name;
  bool inverse, opengl;
};

constexpr Convention kConventions[] = {
    {"rig_from_cam instead of cam_from_rig", true, false},
    {"cameras that look along -z, y up", false, true},
    {"rig_from_cam of cameras that look along -z, y up", true, true}};

RigidTransform PoseBy(const Convention& convention, const RigidTransform& given) {
  const RigidTransform pose = convention.inverse ? given.Inverse() : given;
  if (!convention.opengl) return pose;
  // Half a turn about x.
  return RigidTransform(Eigen::Quaterniond(0, 1, 0, 0), Eigen::Vector3d::Zero()) * pose;
}

}  // namespace

absl::Status CheckConvention(const CalibrationResult& calibration,
                             const std::vector<CameraRows>& rows,
                             const TriangulationOptions& options,
                             const Triangulation& triangulation) {
  const double share = AgreeingShare(triangulation);
  if (share >= kFewAgree) return absl::OkStatus();
  std::vector<CameraRows> some = rows;
  for (CameraRows& camera : some) {
    // Neighbours stay together, so that the period is known.
    if (camera.rows.size() > kRowsTried) camera.rows.resize(kRowsTried);
  }
  for (const Convention& convention : kConventions) {
    CalibrationResult other = calibration;
    other.camera_covariance.clear();
    for (CalibratedCamera& camera : other.cameras) {
      camera.cam_from_rig = PoseBy(convention, camera.cam_from_rig);
    }
    const auto tried = TriangulateRows(other, some, options);
    if (!tried.ok() || tried->points.empty()) continue;
    const double other_share = AgreeingShare(*tried);
    if (other_share < kMostAgree) continue;
    return absl::FailedPreconditionError(absl::StrFormat(
        "the poses of the calibration are of another convention: the rays meet for %.0f %% of the "
        "markers as they are, and for %.0f %% taken as %s",
        100 * share, 100 * other_share, convention.name));
  }
  return absl::FailedPreconditionError(absl::StrFormat(
      "the rows do not fit the calibration: the rays meet for %.0f %% of the markers that two "
      "cameras saw, and no other convention of the poses fits either. Are the rows of these "
      "cameras, has a camera been moved, or were the clocks set anew?",
      100 * share));
}

}  // namespace rigcal
