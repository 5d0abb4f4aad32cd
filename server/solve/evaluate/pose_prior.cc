// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/pose_prior.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <utility>
#include <vector>

#include "common/status/status_macros.h"
#include "server/solve/rig/rig_solver.h"

namespace rigcal::server {
namespace {

// What the prior says of one row of the solve's covariance.
struct PriorRow {
  Eigen::Index solved = 0;
  Eigen::Index prior = 0;
  double difference = 0;  // prior minus solve
};

std::vector<PriorRow> RowsOfPrior(const BundleProblem& problem, const RigPoses& prior,
                                  const RigUncertainty& uncertainty) {
  std::vector<PriorRow> rows;
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    const int known = prior.Find(problem.cameras[c].name);
    if (known < 0) continue;
    const RigidTransform& before = prior.cam_from_rig[static_cast<size_t>(known)];
    const RigidTransform& now = problem.cameras[c].cam_from_rig;
    const Eigen::AngleAxisd turn(Canonical(before.rotation * now.rotation.conjugate()));
    Eigen::Matrix<double, 6, 1> difference;
    difference << turn.angle() * turn.axis(), before.translation_m - now.translation_m;
    for (int i = 0; i < 6; ++i) {
      const Eigen::Index row = uncertainty.Row(
          {i < 3 ? ReducedParameterKind::kRotation : ReducedParameterKind::kTranslation,
           static_cast<int>(c), i % 3});
      if (row >= 0) rows.push_back({row, 6 * known + i, difference[i]});
    }
  }
  for (size_t l = 0; l < prior.lenses.size(); ++l) {
    const RigPoses::Lens& lens = prior.lenses[l];
    const auto camera = std::ranges::find(problem.cameras, lens.camera, &BundleCamera::name);
    const auto known = static_cast<Eigen::Index>(6 * prior.cameras.size() + l);
    if (camera == problem.cameras.end() || !(prior.covariance(known, known) > 0)) continue;
    const Eigen::Index row =
        uncertainty.Row({ReducedParameterKind::kIntrinsic,
                         static_cast<int>(camera - problem.cameras.begin()), lens.component});
    if (row >= 0) rows.push_back({row, known, lens.value - camera->intrinsics[lens.component]});
  }
  return rows;
}

// Moves the estimates by a step of the parameters.
void Move(const std::vector<ReducedParameter>& parameters, const Eigen::VectorXd& step,
          BundleProblem* problem) {
  std::vector<Eigen::Vector3d> turns(problem->cameras.size(), Eigen::Vector3d::Zero());
  for (size_t i = 0; i < parameters.size(); ++i) {
    const ReducedParameter& parameter = parameters[i];
    const auto index = static_cast<size_t>(parameter.index);
    const double value = step[static_cast<Eigen::Index>(i)];
    switch (parameter.kind) {
      case ReducedParameterKind::kRotation:
        turns[index][parameter.component] = value;
        break;
      case ReducedParameterKind::kTranslation:
        problem->cameras[index].cam_from_rig.translation_m[parameter.component] += value;
        break;
      case ReducedParameterKind::kIntrinsic:
        problem->cameras[index].intrinsics[parameter.component] += value;
        break;
      case ReducedParameterKind::kTimeOffset:
        problem->clocks[index].time_offset_s += value;
        break;
      case ReducedParameterKind::kTimeRate:
        problem->clocks[index].time_rate += value;
        break;
      case ReducedParameterKind::kLineDelay:
        problem->cameras[index].line_delay_s += value;
        break;
      case ReducedParameterKind::kMarkerPosition:
        problem->target.marker_positions_m[index] += value;
        break;
      case ReducedParameterKind::kTargetPoint:
        problem->rigid_target.points_m[index][parameter.component] += value;
        break;
    }
  }
  for (size_t c = 0; c < turns.size(); ++c) {
    if (!(turns[c].norm() > 0)) continue;
    Eigen::Quaterniond& rotation = problem->cameras[c].cam_from_rig.rotation;
    rotation =
        (Eigen::Quaterniond(Eigen::AngleAxisd(turns[c].norm(), turns[c].normalized())) * rotation)
            .normalized();
  }
}

}  // namespace

absl::Status AddPosePrior(const RigObservations& rig, const RigPoses& prior,
                          EvaluatedSolution* evaluated) {
  if (!evaluated->uncertainty) {
    return absl::InternalError("the session leaves something undetermined; it refines nothing");
  }
  RigUncertainty& uncertainty = *evaluated->uncertainty;
  const std::vector<PriorRow> rows =
      RowsOfPrior(evaluated->solution.built.problem, prior, uncertainty);
  if (rows.empty()) return absl::OkStatus();
  const auto count = static_cast<Eigen::Index>(rows.size());
  std::vector<Eigen::Index> solved, known;
  Eigen::VectorXd difference(count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const PriorRow& row = rows[static_cast<size_t>(i)];
    solved.push_back(row.solved);
    known.push_back(row.prior);
    difference[i] = row.difference;
  }
  const Eigen::MatrixXd shape = uncertainty.shape_covariance;
  const Eigen::MatrixXd cross = shape(Eigen::all, solved);
  const Eigen::MatrixXd spread =
      Eigen::MatrixXd(shape(solved, solved)) + Eigen::MatrixXd(prior.covariance(known, known));
  // Poses and lenses are of very different size.
  const Eigen::VectorXd units = spread.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::LDLT<Eigen::MatrixXd> factor(
      Eigen::MatrixXd(units.asDiagonal() * spread * units.asDiagonal()));
  const Eigen::MatrixXd scaled = cross * units.asDiagonal();
  const Eigen::VectorXd step = scaled * factor.solve(units.cwiseProduct(difference));
  const Eigen::MatrixXd gained = scaled * factor.solve(scaled.transpose());
  if (!step.allFinite() || !gained.allFinite()) {
    return absl::InternalError("the covariance of the earlier calibration is singular");
  }
  uncertainty.covariance -= gained;
  uncertainty.shape_covariance -= gained;
  Move(uncertainty.parameters, step, &evaluated->solution.built.problem);
  RIGCAL_ASSIGN_OR_RETURN(evaluated->solution,
                          PlaceRig(rig, evaluated->options, InitializationFrom(evaluated->solution),
                                   evaluated->solution));
  DescribeCameras(evaluated->solution.built.problem, &uncertainty);
  return absl::OkStatus();
}

}  // namespace rigcal::server
