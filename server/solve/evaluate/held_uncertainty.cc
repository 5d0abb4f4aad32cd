// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/held_uncertainty.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <vector>

#include "common/status/status_macros.h"
#include "server/solve/bundle/bundle_path.h"

namespace rigcal::server {
namespace {

// Row of a parameter in a list, -1 for none.
Eigen::Index RowIn(const std::vector<ReducedParameter>& parameters,
                   const ReducedParameter& wanted) {
  const auto found = std::ranges::find(parameters, wanted);
  return found == parameters.end() ? -1 : found - parameters.begin();
}

// The held poses that are known with a sigma, and their rows in HeldRig::covariance.
std::vector<ReducedParameter> HeldParameters(const HeldRig& held, std::vector<Eigen::Index>* rows) {
  std::vector<ReducedParameter> parameters;
  for (size_t c = 0; c < held.cam_from_rig.size(); ++c) {
    const auto first = static_cast<Eigen::Index>(6 * c);
    if (!held.Holds(c) || !(held.covariance(first, first) > 0)) continue;
    for (int i = 0; i < 6; ++i) {
      parameters.push_back(
          {i < 3 ? ReducedParameterKind::kRotation : ReducedParameterKind::kTranslation,
           static_cast<int>(c), i % 3});
      rows->push_back(first + i);
    }
  }
  return parameters;
}

// The columns of the anchor, whose pose is fixed in the information: a common motion of all cameras
// turns and shifts camera c by R_c R_anchor^T times what it does to the anchor.
void AddAnchor(const BundleProblem& problem, int anchor, const RigUncertainty& uncertainty,
               const std::vector<ReducedParameter>& held, const Eigen::MatrixXd& own,
               Eigen::MatrixXd* cross) {
  const auto rotation_of = [&problem](int camera) {
    return problem.cameras[static_cast<size_t>(camera)].cam_from_rig.rotation;
  };
  const auto is_pose = [](const ReducedParameter& parameter) {
    return parameter.kind == ReducedParameterKind::kRotation ||
           parameter.kind == ReducedParameterKind::kTranslation;
  };
  const Eigen::MatrixXd others = *cross;
  const auto add = [&](const std::vector<ReducedParameter>& parameters,
                       const Eigen::MatrixXd& information) {
    for (size_t i = 0; i < parameters.size(); ++i) {
      const ReducedParameter& parameter = parameters[i];
      if (!is_pose(parameter) || parameter.index == anchor) continue;
      const Eigen::Matrix3d turn =
          (rotation_of(parameter.index) * rotation_of(anchor).conjugate()).toRotationMatrix();
      for (int j = 0; j < 3; ++j) {
        const Eigen::Index column = RowIn(held, {parameter.kind, anchor, j});
        cross->col(column) -=
            turn(parameter.component, j) * information.col(static_cast<Eigen::Index>(i));
      }
    }
  };
  add(uncertainty.parameters, own);
  add(held, others);
}

}  // namespace

absl::Status AddHeldUncertainty(const RigSolution& solution, const HeldRig& held,
                                RigUncertainty* uncertainty) {
  std::vector<Eigen::Index> held_rows;
  const std::vector<ReducedParameter> parameters = HeldParameters(held, &held_rows);
  uncertainty->scale_sigma_rel = std::max(uncertainty->scale_sigma_rel, held.scale_sigma_rel);
  if (parameters.empty()) return absl::OkStatus();
  BundleProblem problem = solution.built.problem;
  // A problem has one fixed camera at least.
  const int anchor = held.keeps_frame ? parameters.front().index : -1;
  for (const ReducedParameter& parameter : parameters) {
    problem.cameras[static_cast<size_t>(parameter.index)].pose_fixed = parameter.index == anchor;
  }
  RIGCAL_ASSIGN_OR_RETURN(const ReducedInformation information,
                          ComputeInformation(BundleOptions(), problem));
  const auto solved_count = static_cast<Eigen::Index>(uncertainty->parameters.size());
  const auto held_count = static_cast<Eigen::Index>(parameters.size());
  Eigen::MatrixXd own = Eigen::MatrixXd::Identity(solved_count, solved_count);
  Eigen::MatrixXd cross = Eigen::MatrixXd::Zero(solved_count, held_count);
  for (Eigen::Index i = 0; i < solved_count; ++i) {
    const Eigen::Index row =
        RowIn(information.parameters, uncertainty->parameters[static_cast<size_t>(i)]);
    if (row < 0) continue;
    for (Eigen::Index j = 0; j < solved_count; ++j) {
      const Eigen::Index column =
          RowIn(information.parameters, uncertainty->parameters[static_cast<size_t>(j)]);
      if (column >= 0) own(i, j) = information.information(row, column);
    }
    for (Eigen::Index j = 0; j < held_count; ++j) {
      const Eigen::Index column = RowIn(information.parameters, parameters[static_cast<size_t>(j)]);
      if (column >= 0) cross(i, j) = information.information(row, column);
    }
  }
  if (anchor >= 0) AddAnchor(problem, anchor, *uncertainty, parameters, own, &cross);
  const Eigen::VectorXd scale = own.diagonal().cwiseAbs().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * own * scale.asDiagonal();
  const Eigen::MatrixXd follow =
      -(scale.asDiagonal() * scaled.ldlt().solve(scale.asDiagonal() * cross));
  const Eigen::MatrixXd known = held.covariance(held_rows, held_rows);
  const auto extend = [&](const Eigen::MatrixXd& covariance) {
    Eigen::MatrixXd all(solved_count + held_count, solved_count + held_count);
    all.topLeftCorner(solved_count, solved_count) =
        covariance + follow * known * follow.transpose();
    all.topRightCorner(solved_count, held_count) = follow * known;
    all.bottomLeftCorner(held_count, solved_count) = known * follow.transpose();
    all.bottomRightCorner(held_count, held_count) = known;
    return all;
  };
  // What the held rig leaves of the scale is in its own covariance: nothing is taken out again.
  uncertainty->shape_covariance = extend(uncertainty->covariance);
  uncertainty->noise_covariance =
      extend(uncertainty->noise_covariance.size() > 0 ? uncertainty->noise_covariance
                                                      : uncertainty->covariance);
  uncertainty->covariance = uncertainty->shape_covariance;
  uncertainty->parameters.insert(uncertainty->parameters.end(), parameters.begin(),
                                 parameters.end());
  return absl::OkStatus();
}

}  // namespace rigcal::server
