// SPDX-License-Identifier: Apache-2.0
#include "server/solve/kept_frame.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/calibration/camera_covariance.h"
#include "common/origin/frame_change.h"
#include "common/status/status_macros.h"
#include "server/solve/evaluate/rig_difference.h"

namespace rigcal::server {
namespace {

using PoseMatrix = Eigen::Matrix<double, 6, 6>;

// How far the frame may be from the first alignment, one sigma.
constexpr double kFreeTurnRad = 0.1, kFreeShiftM = 1;
constexpr int kFrameRounds = 3;
constexpr double kUnseenM = 1e-6;  // of a pose that nothing is known to be off

Eigen::Matrix3d CrossOfVector(const Eigen::Vector3d& v) {
  Eigen::Matrix3d cross;
  cross << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return cross;
}

// The rows of one camera in a joint covariance; without a pose: exact.
Eigen::MatrixXd PoseSelector(const CameraCovariance& covariance, size_t camera) {
  Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(6, covariance.matrix.rows());
  const CameraParameters& parameters = covariance.cameras[camera];
  if (parameters.has_pose) rows.middleCols<6>(parameters.first_row).setIdentity();
  return rows;
}

size_t IndexOfCamera(const CalibrationResult& calibration, const std::string& name) {
  return static_cast<size_t>(
      std::ranges::find(calibration.cameras, name, &CalibratedCamera::camera) -
      calibration.cameras.begin());
}

// The linear problem about a frame: differences of poses, and how they follow what.
struct FrameProblem {
  Eigen::VectorXd difference;          // new poses in this frame, minus the earlier
  Eigen::MatrixXd by_frame;            // 6 columns
  Eigen::MatrixXd by_now, by_earlier;  // columns as the joint covariances
  Eigen::MatrixXd covariance;          // of the difference, frame fixed
};

FrameProblem LineariseFrame(const CalibrationResult& earlier, const CameraCovariance& earlier_known,
                            const CalibrationResult& now, const CameraCovariance& now_known,
                            const std::vector<std::string>& cameras,
                            const RigidTransform& earlier_from_now) {
  const auto size = static_cast<Eigen::Index>(6 * cameras.size());
  FrameProblem problem;
  problem.difference.resize(size);
  problem.by_frame.resize(size, 6);
  problem.by_now.resize(size, now_known.matrix.rows());
  problem.by_earlier.resize(size, earlier_known.matrix.rows());
  for (size_t i = 0; i < cameras.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(6 * i);
    const size_t a = IndexOfCamera(earlier, cameras[i]), b = IndexOfCamera(now, cameras[i]);
    const RigidTransform& before = earlier.cameras[a].cam_from_rig;
    const RigidTransform moved = now.cameras[b].cam_from_rig * earlier_from_now.Inverse();
    const Eigen::AngleAxisd turn(Canonical(moved.rotation * before.rotation.conjugate()));
    problem.difference.segment<3>(row) = turn.angle() * turn.axis();
    problem.difference.segment<3>(row + 3) = moved.translation_m - before.translation_m;
    // As in ChangeFrame.
    const Eigen::Matrix3d rotation = moved.rotation.toRotationMatrix();
    const Eigen::Matrix3d lever = CrossOfVector(rotation * earlier_from_now.translation_m);
    PoseMatrix by_frame = PoseMatrix::Zero(), by_pose = PoseMatrix::Identity();
    by_frame.topLeftCorner<3, 3>() = by_frame.bottomRightCorner<3, 3>() = -rotation;
    by_frame.bottomLeftCorner<3, 3>() = -lever * rotation;
    by_pose.bottomLeftCorner<3, 3>() = lever;
    problem.by_frame.middleRows<6>(row) = by_frame;
    problem.by_now.middleRows<6>(row) = by_pose * PoseSelector(now_known, b);
    problem.by_earlier.middleRows<6>(row) = -PoseSelector(earlier_known, a);
  }
  problem.covariance = problem.by_now * now_known.matrix * problem.by_now.transpose() +
                       problem.by_earlier * earlier_known.matrix * problem.by_earlier.transpose() +
                       kUnseenM * kUnseenM * Eigen::MatrixXd::Identity(size, size);
  return problem;
}

RigidTransform Moved(const RigidTransform& frame, const Eigen::Matrix<double, 6, 1>& step) {
  RigidTransform moved = frame;
  const Eigen::Vector3d turn = step.head<3>();
  if (turn.norm() > 0) {
    moved.rotation =
        (Eigen::Quaterniond(Eigen::AngleAxisd(turn.norm(), turn.normalized())) * frame.rotation)
            .normalized();
  }
  moved.translation_m += step.tail<3>();
  return moved;
}

// By the cameras' centres alone.
RigidTransform FirstFrameOf(const CalibrationResult& earlier, const CalibrationResult& now,
                            const std::vector<std::string>& cameras,
                            const Eigen::Quaterniond& earlier_from_now) {
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();
  for (const std::string& name : cameras) {
    const auto centre = [&name](const CalibrationResult& calibration) {
      return calibration.cameras[IndexOfCamera(calibration, name)]
          .cam_from_rig.SourceFromTargetTranslation();
    };
    shift += centre(earlier) - earlier_from_now * centre(now);
  }
  return {earlier_from_now, shift / static_cast<double>(cameras.size())};
}

}  // namespace

absl::StatusOr<CalibrationResult> KeepFrame(const CalibrationResult& earlier,
                                            const std::string& earlier_id,
                                            const CalibrationResult& now) {
  const std::string what = absl::StrCat("the frame of calibration ", earlier_id, " is not kept: ");
  const absl::StatusOr<RigDifference> compared = CompareRigs(earlier, now);
  if (!compared.ok()) {
    return absl::Status(compared.status().code(),
                        absl::StrCat(what, std::string(compared.status().message())));
  }
  if (!compared->problem.empty()) {
    return absl::FailedPreconditionError(absl::StrCat(what, compared->problem));
  }
  const std::vector<std::string>& cameras = compared->frame_cameras;
  if (cameras.size() < 2) {
    return absl::FailedPreconditionError(
        absl::StrCat(what, cameras.size(), " cameras are where they were, and two are needed"));
  }
  const CameraCovariance earlier_known = UnpackCameraCovariance(earlier);
  const CameraCovariance now_known = UnpackCameraCovariance(now);
  FrameChange change;
  change.new_from_rig =
      FirstFrameOf(earlier, now, cameras, compared->b_from_a.rotation.conjugate());
  PoseMatrix wide = PoseMatrix::Zero();
  wide.diagonal() << Eigen::Vector3d::Constant(kFreeTurnRad * kFreeTurnRad),
      Eigen::Vector3d::Constant(kFreeShiftM * kFreeShiftM);
  for (int round = 0; round < kFrameRounds; ++round) {
    const FrameProblem problem =
        LineariseFrame(earlier, earlier_known, now, now_known, cameras, change.new_from_rig);
    const Eigen::MatrixXd spread =
        problem.covariance + problem.by_frame * wide * problem.by_frame.transpose();
    const Eigen::LDLT<Eigen::MatrixXd> factor(spread);
    const Eigen::MatrixXd solved = factor.solve(problem.by_frame);
    const Eigen::MatrixXd gain = wide * solved.transpose();
    const Eigen::VectorXd step = -gain * problem.difference;
    if (!step.allFinite()) {
      return absl::FailedPreconditionError(
          absl::StrCat(what, "the covariances of both are singular"));
    }
    change.new_from_rig = Moved(change.new_from_rig, step);
    change.by_parameters = -gain * problem.by_now;
    const Eigen::MatrixXd by_earlier = -gain * problem.by_earlier;
    const double squared = problem.difference.dot(factor.solve(problem.difference));
    const double degrees = std::max(1.0, static_cast<double>(problem.difference.size()) - 6);
    change.own_covariance = std::max(1.0, squared / degrees) *
                            (by_earlier * earlier_known.matrix * by_earlier.transpose());
  }
  CalibrationResult kept = ChangeFrame(now, change);
  CalibrationFrame& frame = kept.frame.emplace();
  frame.source = FrameSource::kKept;
  frame.calibration_id = earlier_id;
  frame.new_from_rig = change.new_from_rig;
  const PoseMatrix covariance = change.Covariance(now_known);
  frame.rotation_sigma_rad = covariance.diagonal().head<3>().cwiseMax(0).cwiseSqrt();
  frame.position_sigma_m = covariance.diagonal().tail<3>().cwiseMax(0).cwiseSqrt();
  frame.cameras = cameras;
  frame.lowest_camera_m = std::numeric_limits<double>::infinity();
  for (const CalibratedCamera& camera : kept.cameras) {
    const double z_m = camera.cam_from_rig.SourceFromTargetTranslation().z();
    if (z_m >= frame.lowest_camera_m) continue;
    frame.lowest_camera_m = z_m;
    frame.lowest_camera = camera.camera;
  }
  return kept;
}

std::optional<CalibrationFrame> InheritedFrame(const CalibrationResult& parent,
                                               const std::string& parent_id) {
  if (!parent.frame || !parent.frame->IsOwn()) return std::nullopt;
  CalibrationFrame frame;
  frame.source = FrameSource::kKept;
  frame.calibration_id = parent_id;
  frame.rotation_sigma_rad = parent.frame->rotation_sigma_rad;
  frame.position_sigma_m = parent.frame->position_sigma_m;
  frame.lowest_camera = parent.frame->lowest_camera;
  frame.lowest_camera_m = parent.frame->lowest_camera_m;
  for (const CalibratedCamera& camera : parent.cameras) frame.cameras.push_back(camera.camera);
  return frame;
}

}  // namespace rigcal::server
