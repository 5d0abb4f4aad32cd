// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/rig_difference.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/complement.hpp>
#include <boost/math/distributions/normal.hpp>
#include <cmath>
#include <limits>
#include <optional>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/camera/camera_model.h"
#include "common/camera/intrinsics_vector.h"
#include "common/statistics/robust_statistics.h"
#include "common/status/status_macros.h"
#include "server/solve/evaluate/moved_set.h"
#include "server/solve/evaluate/pose_covariance.h"

namespace rigcal::server {
namespace {

using Pose6 = Eigen::Matrix<double, 6, 1>;
using Cov6 = Eigen::Matrix<double, 6, 6>;

// How far the frames may still be apart after the first alignment, one sigma.
constexpr double kFrameTurnRad = 0.1, kFrameShiftM = 1;
// Of two scales that the same wand gave, relative.
constexpr double kSameWandScale = 2e-4;
constexpr int kRounds = 3;
constexpr double kHiddenSigmas = 3;
// Of a lens that was refined by a wave: what it may be off at the middle of another wave.
constexpr double kLensErrorPx = 0.25;

Eigen::Matrix3d CrossOf(const Eigen::Vector3d& v) {
  Eigen::Matrix3d cross;
  cross << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return cross;
}

Eigen::Vector3d RotationVector(const Eigen::Quaterniond& rotation) {
  const Eigen::AngleAxisd turn(Canonical(rotation));
  return turn.angle() * turn.axis();
}

// Of the same cameras, in the same order.
RigPoses Select(const RigPoses& poses, const std::vector<std::string>& names) {
  RigPoses selected;
  selected.cameras = names;
  selected.scale_sigma_rel = poses.scale_sigma_rel;
  std::vector<Eigen::Index> rows;
  for (const std::string& name : names) {
    const int c = poses.Find(name);
    selected.cam_from_rig.push_back(poses.cam_from_rig[static_cast<size_t>(c)]);
    for (int i = 0; i < 6; ++i) rows.push_back(6 * c + i);
  }
  selected.covariance = poses.covariance(rows, rows);
  return selected;
}

// B's rig frame and scale against A's.
struct Frame {
  RigidTransform b_from_a;  // x_b = scale * (rotation * x_a + translation)
  double scale = 1;

  RigidTransform InA(const RigidTransform& cam_from_b) const {
    return {(cam_from_b.rotation * b_from_a.rotation).normalized(),
            cam_from_b.rotation * b_from_a.translation_m + cam_from_b.translation_m / scale};
  }
};

Pose6 Difference(const RigidTransform& a, const RigidTransform& b) {
  Pose6 difference;
  difference << RotationVector(b.rotation * a.rotation.conjugate()),
      b.translation_m - a.translation_m;
  return difference;
}

// That of the camera by which most others agree.
Frame FirstFrame(const RigPoses& a, const RigPoses& b) {
  Frame best;
  double best_m = std::numeric_limits<double>::infinity();
  for (size_t anchor = 0; anchor < a.cameras.size(); ++anchor) {
    Frame frame;
    const Eigen::Quaterniond back = b.cam_from_rig[anchor].rotation.conjugate();
    frame.b_from_a = {back * a.cam_from_rig[anchor].rotation,
                      back * Eigen::Vector3d(a.cam_from_rig[anchor].translation_m -
                                             b.cam_from_rig[anchor].translation_m)};
    std::vector<double> apart_m;
    for (size_t c = 0; c < a.cameras.size(); ++c) {
      apart_m.push_back(Difference(a.cam_from_rig[c], frame.InA(b.cam_from_rig[c])).norm());
    }
    const double middle_m = LowerQuantile(&apart_m, 0.5);
    if (middle_m >= best_m) continue;
    best_m = middle_m;
    best = frame;
  }
  return best;
}

// The differences of all poses in one vector, and their covariance with the frame's and the
// scale's; linear about `frame`.
struct Linear {
  Eigen::VectorXd difference;
  Eigen::MatrixXd covariance;
  Eigen::MatrixXd frame_gain;  // of the frame's turn, shift and scale: 7 columns
  Eigen::Matrix<double, 7, 1> frame_variance;
};

const CalibratedCamera& CameraNamed(const CalibrationResult& calibration, const std::string& name) {
  return *std::ranges::find(calibration.cameras, name, &CalibratedCamera::camera);
}

// What a lens leaves unexplained moves the poses of two waves apart, as if the camera had turned or
// shifted by that much in its image. Where the lens was given, its calibration was made with
// targets that fill the image, and nothing is added.
void AllowForLenses(const CalibrationResult& by, const Eigen::Vector3d& centre_m,
                    const std::vector<std::string>& names, Linear* linear) {
  for (size_t c = 0; c < names.size(); ++c) {
    const CalibratedCamera& camera = CameraNamed(by, names[c]);
    if (!camera.intrinsics_refined) continue;
    const double angle = kLensErrorPx / camera.intrinsics.fx_px;
    const double distance_m = (camera.cam_from_rig * centre_m).norm();
    Eigen::Matrix<double, 6, 3> turn;  // about the camera's centre
    turn << Eigen::Matrix3d::Identity(), -CrossOf(camera.cam_from_rig.translation_m);
    const auto row = static_cast<Eigen::Index>(6 * c);
    linear->covariance.block<6, 6>(row, row) += angle * angle * turn * turn.transpose();
    linear->covariance.block<3, 3>(row + 3, row + 3) +=
        angle * angle * distance_m * distance_m * Eigen::Matrix3d::Identity();
  }
}

Linear Linearise(const RigPoses& a, const RigPoses& b, const Frame& frame, double scale_sigma) {
  const auto size = static_cast<Eigen::Index>(6 * a.cameras.size());
  Linear linear;
  linear.difference.resize(size);
  linear.frame_gain = Eigen::MatrixXd::Zero(size, 7);
  Eigen::MatrixXd moved = Eigen::MatrixXd::Zero(size, size);
  for (size_t c = 0; c < a.cameras.size(); ++c) {
    const auto row = static_cast<Eigen::Index>(6 * c);
    const RigidTransform& in_b = b.cam_from_rig[c];
    linear.difference.segment<6>(row) = Difference(a.cam_from_rig[c], frame.InA(in_b));
    const Eigen::Matrix3d turn = in_b.rotation.toRotationMatrix();
    linear.frame_gain.block<3, 3>(row, 0) = turn;
    linear.frame_gain.block<3, 3>(row + 3, 3) = turn;
    linear.frame_gain.block<3, 1>(row + 3, 6) = -in_b.translation_m / frame.scale;
    moved.block<3, 3>(row, row).setIdentity();
    moved.block<3, 3>(row + 3, row) = -CrossOf(in_b.rotation * frame.b_from_a.translation_m);
    moved.block<3, 3>(row + 3, row + 3) = Eigen::Matrix3d::Identity() / frame.scale;
  }
  linear.frame_variance << Eigen::Vector3d::Constant(kFrameTurnRad * kFrameTurnRad),
      Eigen::Vector3d::Constant(kFrameShiftM * kFrameShiftM), scale_sigma * scale_sigma;
  linear.covariance =
      a.covariance + moved * b.covariance * moved.transpose() +
      linear.frame_gain * linear.frame_variance.asDiagonal() * linear.frame_gain.transpose();
  return linear;
}

std::vector<Eigen::Index> RowsOfCameras(const std::vector<size_t>& cameras) {
  std::vector<Eigen::Index> rows;
  for (const size_t c : cameras) {
    for (int i = 0; i < 6; ++i) rows.push_back(static_cast<Eigen::Index>(6 * c) + i);
  }
  return rows;
}

// The frame moved to where the cameras of the set agree best.
Frame Aligned(const Linear& linear, const std::vector<size_t>& set, Frame frame) {
  const std::vector<Eigen::Index> rows = RowsOfCameras(set);
  const Eigen::MatrixXd covariance = linear.covariance(rows, rows);
  const Eigen::VectorXd pull = covariance.ldlt().solve(linear.difference(rows));
  const Eigen::Matrix<double, 7, 1> apart =
      linear.frame_variance.asDiagonal() *
      Eigen::MatrixXd(linear.frame_gain(rows, Eigen::all)).transpose() * pull;
  const Eigen::Vector3d turn = -apart.head<3>();
  if (turn.norm() > 0) {
    frame.b_from_a.rotation =
        (Eigen::Quaterniond(Eigen::AngleAxisd(turn.norm(), turn.normalized())) *
         frame.b_from_a.rotation)
            .normalized();
  }
  frame.b_from_a.translation_m -= apart.segment<3>(3);
  frame.scale *= 1 - apart[6];
  return frame;
}

// Difference of one camera against those of the set, itself left out.
struct Conditional {
  Pose6 difference;
  Cov6 covariance;
};

Conditional Against(const Linear& linear, std::vector<size_t> set, size_t camera) {
  std::erase(set, camera);
  const std::vector<Eigen::Index> others = RowsOfCameras(set), own = RowsOfCameras({camera});
  if (others.empty()) return {linear.difference(own), linear.covariance(own, own)};
  const Eigen::MatrixXd cross = linear.covariance(own, others);
  const Eigen::MatrixXd covariance = linear.covariance(others, others);
  const Eigen::LDLT<Eigen::MatrixXd> factor(covariance);
  return {linear.difference(own) - cross * factor.solve(linear.difference(others)),
          linear.covariance(own, own) - cross * factor.solve(cross.transpose())};
}

double SigmaAlong(const Eigen::Vector3d& direction, const Eigen::Matrix3d& covariance) {
  const Eigen::Vector3d unit = direction.norm() > 0 ? Eigen::Vector3d(direction.normalized())
                                                    : Eigen::Vector3d(Eigen::Vector3d::UnitX());
  return std::sqrt(std::max(0.0, unit.dot(covariance * unit)));
}

// The normal value that is as unlikely as a squared distance with 6 degrees of freedom.
double NormalSigmas(double squared) {
  const double chance = boost::math::cdf(
      boost::math::complement(boost::math::chi_squared(6), std::max(0.0, squared)));
  if (!(chance > 1e-200)) return std::sqrt(squared);
  return boost::math::quantile(
      boost::math::complement(boost::math::normal(), std::min(0.5, chance / 2)));
}

void DescribePixels(const CalibratedCamera& camera, const Eigen::Vector3d& centre_m,
                    const Conditional& conditional, CameraDifference* result) {
  const Eigen::Vector3d turned = camera.cam_from_rig.rotation * centre_m;
  const Eigen::Vector3d point = turned + camera.cam_from_rig.translation_m;
  const IntrinsicsVector intrinsics = ToVector(camera.intrinsics);
  Eigen::Vector2d pixel;
  Eigen::Matrix<double, 2, 3> slope;
  IntrinsicsJacobian by_intrinsics;
  if (!Project(camera.intrinsics.model, intrinsics.data(), point, &pixel, &slope, &by_intrinsics)) {
    return;
  }
  Eigen::Matrix<double, 2, 6> gain;
  gain << -slope * CrossOf(turned), slope;
  result->centre_px = (gain * conditional.difference).norm();
  const Eigen::Matrix2d covariance = gain * conditional.covariance * gain.transpose();
  result->centre_sigma_px = std::sqrt(
      std::max(0.0, Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(covariance).eigenvalues()[1]));
}

CameraDifference Describe(const CalibratedCamera& camera, const Eigen::Vector3d& centre_m,
                          const Conditional& conditional) {
  CameraDifference result;
  result.camera = camera.camera;
  const Eigen::Vector3d turn = conditional.difference.head<3>();
  result.rotation_rad = turn.norm();
  result.rotation_sigma_rad = SigmaAlong(turn, conditional.covariance.topLeftCorner<3, 3>());
  Eigen::Matrix<double, 3, 6> centre;  // in the camera's axes
  centre << -CrossOf(camera.cam_from_rig.translation_m), -Eigen::Matrix3d::Identity();
  const Eigen::Vector3d shift = centre * conditional.difference;
  result.translation_m = shift.norm();
  result.translation_sigma_m =
      SigmaAlong(shift, centre * conditional.covariance * centre.transpose());
  result.sigmas = NormalSigmas(
      conditional.difference.dot(conditional.covariance.ldlt().solve(conditional.difference)));
  DescribePixels(camera, centre_m, conditional, &result);
  return result;
}

// Cameras whose poses were found with the same intrinsics.
std::vector<std::string> SameLenses(const CalibrationResult& a, const CalibrationResult& b) {
  std::vector<std::string> same;
  for (const CalibratedCamera& camera : a.cameras) {
    const auto other = std::ranges::find(b.cameras, camera.camera, &CalibratedCamera::camera);
    if (other != b.cameras.end() && other->intrinsics == camera.intrinsics) {
      same.push_back(camera.camera);
    }
  }
  return same;
}

// Against the median: where the clocks' common zero lies says nothing.
void CompareClocks(const CalibrationResult& a, const CalibrationResult& b, RigDifference* result) {
  std::vector<double> offsets_s;
  const auto estimated = [](const CalibratedCamera& camera) {
    return camera.time_offset_estimated && camera.uncertainty;
  };
  for (CameraDifference& camera : result->cameras) {
    const CalibratedCamera &in_a = CameraNamed(a, camera.camera),
                           &in_b = CameraNamed(b, camera.camera);
    if (!estimated(in_a) || !estimated(in_b)) continue;
    camera.time_offset_s = in_b.time_offset_s - in_a.time_offset_s;
    camera.time_offset_sigma_s =
        std::hypot(in_a.uncertainty->time_offset_sigma_s, in_b.uncertainty->time_offset_sigma_s);
    offsets_s.push_back(camera.time_offset_s);
  }
  if (offsets_s.empty()) return;
  const double median_s = Median(offsets_s);
  for (CameraDifference& camera : result->cameras) {
    if (camera.time_offset_sigma_s > 0) camera.time_offset_s -= median_s;
  }
}

void GiveVerdicts(const MovedSet& found, RigDifference* result) {
  for (size_t c = 0; c < result->cameras.size(); ++c) {
    CameraDifference& camera = result->cameras[c];
    const bool moved = std::ranges::find(found.moved, c) != found.moved.end();
    const bool hidden = !(kHiddenSigmas * camera.centre_sigma_px < kHiddenPx);
    camera.verdict = !found.problem.empty() ? CameraDifference::Verdict::kUnknown
                     : moved                ? CameraDifference::Verdict::kMoved
                     : hidden               ? CameraDifference::Verdict::kUnknown
                                            : CameraDifference::Verdict::kSame;
    if (found.problem.empty() && !moved) result->frame_cameras.push_back(camera.camera);
  }
}

}  // namespace

std::vector<std::string> RigDifference::Moved() const {
  std::vector<std::string> moved;
  for (const CameraDifference& camera : cameras) {
    if (camera.verdict == CameraDifference::Verdict::kMoved) moved.push_back(camera.camera);
  }
  return moved;
}

absl::StatusOr<RigDifference> CompareRigs(const CalibrationResult& a, const CalibrationResult& b) {
  const std::vector<std::string> lenses = SameLenses(a, b);
  RIGCAL_ASSIGN_OR_RETURN(const RigPoses all_a, PosesOf(a, lenses));
  RIGCAL_ASSIGN_OR_RETURN(const RigPoses all_b, PosesOf(b, lenses));
  RigDifference result;
  std::vector<std::string> names;
  for (const std::string& name : all_a.cameras) {
    (all_b.Find(name) >= 0 ? names : result.only_in_a).push_back(name);
  }
  for (const std::string& name : all_b.cameras) {
    if (all_a.Find(name) < 0) result.only_in_b.push_back(name);
  }
  if (names.size() < 2) {
    return absl::FailedPreconditionError(absl::StrCat(
        "the calibrations have ", names.size(), " cameras in common, and two are needed: ",
        absl::StrJoin(all_a.cameras, ", "), " and ", absl::StrJoin(all_b.cameras, ", ")));
  }
  const RigPoses poses_a = Select(all_a, names), poses_b = Select(all_b, names);
  const bool same_wand = a.target.given == b.target.given;
  const double scale_sigma =
      same_wand ? kSameWandScale
                : std::hypot(poses_a.scale_sigma_rel, poses_b.scale_sigma_rel, kSameWandScale);
  if (a.wand_volume) result.centre_m = 0.5 * (a.wand_volume->min_m + a.wand_volume->max_m);

  Frame frame = FirstFrame(poses_a, poses_b);
  Linear linear;
  MovedSet found;
  for (int round = 0; round < kRounds; ++round) {
    linear = Linearise(poses_a, poses_b, frame, scale_sigma);
    AllowForLenses(a, result.centre_m, names, &linear);
    found = FindMovedSet(linear.difference, linear.covariance);
    if (round + 1 < kRounds) frame = Aligned(linear, found.still, frame);
  }
  result.b_from_a = frame.b_from_a;
  result.scale_difference = frame.scale - 1;
  result.problem = found.problem;
  for (size_t c = 0; c < names.size(); ++c) {
    result.cameras.push_back(
        Describe(CameraNamed(a, names[c]), result.centre_m, Against(linear, found.still, c)));
  }
  GiveVerdicts(found, &result);
  CompareClocks(a, b, &result);
  return result;
}

}  // namespace rigcal::server
