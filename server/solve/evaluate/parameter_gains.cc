// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/parameter_gains.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>

#include "absl/strings/str_cat.h"

namespace rigcal::server {
namespace {

using InformationKind = ParameterInformation::Kind;

constexpr int kMotions = 6;  // a turn and a shift

Eigen::Index Count(const std::vector<std::vector<int>>& lists) {
  return static_cast<Eigen::Index>(lists.size());
}

Eigen::Matrix3d CrossProductMatrix(const Eigen::Vector3d& v) {
  Eigen::Matrix3d cross;
  cross << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return cross;
}

// A turn and a shift of everything, at a point.
Eigen::Matrix<double, 3, 6> MotionOf(const Eigen::Vector3d& point_m) {
  Eigen::Matrix<double, 3, 6> motion;
  motion << -CrossProductMatrix(point_m), Eigen::Matrix3d::Identity();
  return motion;
}

}  // namespace

std::vector<WantedParameter> WantedParametersOf(const GroupedProblem& grouped) {
  static constexpr std::array<const char*, 3> kAxes = {"x", "y", "z"};
  static constexpr std::array<const char*, 4> kFocal = {"fx", "fy", "cx", "cy"};
  std::vector<WantedParameter> wanted;
  const BundleProblem& problem = grouped.problem;
  const auto fixed = std::ranges::count(problem.cameras, true, &BundleCamera::pose_fixed);
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    const BundleCamera& camera = problem.cameras[c];
    for (const InformationKind kind : {InformationKind::kPosition, InformationKind::kRotation}) {
      // With several of them the fixed ones are known, and nothing here holds them.
      if (camera.pose_fixed && fixed > 1) continue;
      for (int i = 0; i < 3; ++i) wanted.push_back({c, kind, i, kAxes[static_cast<size_t>(i)]});
    }
    const int clock = grouped.clock_of_camera[c];
    const bool estimated =
        clock >= 0 && std::ranges::any_of(problem.clocks,
                                          [](const BundleClock& one) { return !one.offset_fixed; });
    if (estimated) wanted.push_back({c, InformationKind::kTimeOffset, 0, "offset"});
    if (camera.intrinsics_fixed) continue;
    for (int i = 0; i < static_cast<int>(camera.intrinsics.size()); ++i) {
      if (!(camera.intrinsics_sigma[i] > 0)) continue;
      wanted.push_back(
          {c, InformationKind::kIntrinsic, i,
           i < 4 ? std::string(kFocal[static_cast<size_t>(i)]) : absl::StrCat("d", i - 3)});
    }
  }
  return wanted;
}

ParameterGains::ParameterGains(const GroupedProblem& grouped, const ParameterKnowledge& knowledge,
                               const BundleProblem& problem, const JoinedCameras& joined,
                               const Eigen::Vector3d& middle_m, const Eigen::Matrix3d& axes)
    : grouped_(grouped), knowledge_(knowledge), problem_(problem), joined_(joined), axes_(axes) {
  common_ = Eigen::MatrixXd::Zero(knowledge.size(), kMotions + Count(grouped.clocks_of_session));
  const auto fixed = std::ranges::count(problem.cameras, true, &BundleCamera::pose_fixed);
  if (fixed == 1) FitMotion(middle_m);
  AddMeanOffsets();
}

bool ParameterGains::Of(const WantedParameter& wanted, ParameterKnowledge::Gain* gain) const {
  gain->own.clear();
  gain->of_common = Eigen::VectorXd::Zero(common_.cols());
  switch (wanted.kind) {
    case InformationKind::kTimeOffset:
      return Offset(wanted.camera, gain);
    case InformationKind::kIntrinsic: {
      const Eigen::Index row = knowledge_.Row(
          {ReducedParameterKind::kIntrinsic, static_cast<int>(wanted.camera), wanted.component});
      if (row >= 0) gain->own.emplace_back(row, 1);
      return row >= 0;
    }
    default:
      break;
  }
  if (!joined_.camera[wanted.camera] || (has_motion_ && !motion_known_)) return false;
  const RigidTransform& pose = problem_.cameras[wanted.camera].cam_from_rig;
  if (wanted.kind == InformationKind::kPosition) {
    const Eigen::Vector3d centre_m = pose.SourceFromTargetTranslation();
    const Eigen::RowVector3d axis = axes_.row(wanted.component);
    for (const PointColumn& column : PointColumns(wanted.camera, centre_m)) {
      gain->own.emplace_back(column.row, axis.dot(column.derivative_m));
    }
    if (has_motion_) gain->of_common.head<kMotions>() = -(axis * MotionOf(centre_m)).transpose();
    return true;
  }
  const Eigen::Index row = knowledge_.Row(
      {ReducedParameterKind::kRotation, static_cast<int>(wanted.camera), wanted.component});
  if (row >= 0) gain->own.emplace_back(row, 1);
  if (has_motion_) {
    gain->of_common.head<3>() = pose.rotation.toRotationMatrix().row(wanted.component).transpose();
  }
  return true;
}

// As in attached_point.cc.
std::vector<ParameterGains::PointColumn> ParameterGains::PointColumns(
    size_t camera, const Eigen::Vector3d& point_m) const {
  std::vector<PointColumn> columns;
  const RigidTransform& pose = problem_.cameras[camera].cam_from_rig;
  const Eigen::Matrix3d back = pose.rotation.toRotationMatrix().transpose();
  const Eigen::Matrix3d turn = back * CrossProductMatrix(pose.rotation * point_m);
  for (int i = 0; i < 3; ++i) {
    const auto index = static_cast<int>(camera);
    const Eigen::Index w = knowledge_.Row({ReducedParameterKind::kRotation, index, i});
    const Eigen::Index d = knowledge_.Row({ReducedParameterKind::kTranslation, index, i});
    if (w >= 0) columns.push_back({w, turn.col(i)});
    if (d >= 0) columns.push_back({d, -back.col(i)});
  }
  return columns;
}

// The best rigid motion of the centres and of the places that the cameras look at.
void ParameterGains::FitMotion(const Eigen::Vector3d& middle_m) {
  has_motion_ = true;
  Eigen::Matrix<double, kMotions, kMotions> normal =
      Eigen::Matrix<double, kMotions, kMotions>::Zero();
  Eigen::MatrixXd right = Eigen::MatrixXd::Zero(kMotions, knowledge_.size());
  int count = 0;
  for (size_t c = 0; c < problem_.cameras.size(); ++c) {
    if (!joined_.camera[c]) continue;
    ++count;
    for (const Eigen::Vector3d& point_m :
         {problem_.cameras[c].cam_from_rig.SourceFromTargetTranslation(), middle_m}) {
      const Eigen::Matrix<double, 3, kMotions> motion = MotionOf(point_m);
      normal += motion.transpose() * motion;
      for (const PointColumn& column : PointColumns(c, point_m)) {
        right.col(column.row) += motion.transpose() * column.derivative_m;
      }
    }
  }
  motion_known_ = count >= 2;
  if (motion_known_) common_.leftCols<kMotions>() = normal.ldlt().solve(right).transpose();
}

// Of the clocks that are seen.
void ParameterGains::AddMeanOffsets() {
  for (size_t s = 0; s < grouped_.clocks_of_session.size(); ++s) {
    std::vector<int> seen;
    for (const int k : grouped_.clocks_of_session[s]) {
      if (joined_.clock[static_cast<size_t>(k)]) seen.push_back(k);
    }
    for (const int k : seen) {
      const Eigen::Index row = knowledge_.Row({ReducedParameterKind::kTimeOffset, k, 0});
      if (row < 0) continue;
      common_(row, kMotions + static_cast<Eigen::Index>(s)) += 1 / static_cast<double>(seen.size());
    }
  }
}

// Against the mean of the clocks that are seen in its session.
bool ParameterGains::Offset(size_t camera, ParameterKnowledge::Gain* gain) const {
  const int own = grouped_.clock_of_camera[camera];
  if (own < 0 || !joined_.clock[static_cast<size_t>(own)]) return false;
  for (size_t s = 0; s < grouped_.clocks_of_session.size(); ++s) {
    const std::vector<int>& clocks = grouped_.clocks_of_session[s];
    if (std::ranges::find(clocks, own) == clocks.end()) continue;
    const Eigen::Index row = knowledge_.Row({ReducedParameterKind::kTimeOffset, own, 0});
    if (row >= 0) gain->own.emplace_back(row, 1);
    gain->of_common[kMotions + static_cast<Eigen::Index>(s)] = -1;
    return true;
  }
  return false;
}

}  // namespace rigcal::server
