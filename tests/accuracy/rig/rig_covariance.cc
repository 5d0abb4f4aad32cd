// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/rig/rig_covariance.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <functional>
#include <utility>

#include "common/status/status_macros.h"
#include "server/solve/bundle/line_bundle.h"
#include "server/solve/evaluate/uncertainty.h"

namespace rigcal::accuracy {
namespace {

using server::ReducedParameter;
using server::ReducedParameterKind;

const CameraError& ErrorOfCamera(const CalibrationErrors& errors, int camera) {
  return *std::find_if(errors.cameras.begin(), errors.cameras.end(),
                       [camera](const CameraError& error) { return error.index == camera; });
}

double ErrorOf(const CalibrationErrors& errors, const RigParameter& parameter) {
  if (parameter.kind == RigParameterKind::kMarkerPosition) {
    return errors.marker_positions_m[static_cast<size_t>(parameter.camera) - 1];
  }
  const CameraError& camera = ErrorOfCamera(errors, parameter.camera);
  const CameraError& reference = ErrorOfCamera(errors, errors.reference);
  switch (parameter.kind) {
    case RigParameterKind::kRotation:
      return camera.pose.rotation_rad[parameter.component];
    case RigParameterKind::kPosition:
      return camera.pose.position_m[parameter.component];
    case RigParameterKind::kTimeOffset:
      return camera.time_offset_s - reference.time_offset_s;
    case RigParameterKind::kTimeRate:
      return 1e-6 * (camera.time_rate_ppm - reference.time_rate_ppm);
    case RigParameterKind::kLineDelay:
      return camera.line_delay_s;
    default:
      // Not refined: the error of the given ones is not known here.
      return camera.intrinsics.empty()
                 ? 0
                 : camera.intrinsics[static_cast<size_t>(parameter.component)];
  }
}

Nees Part(const CalibrationErrors& errors, const RigCovariance& covariance,
          const std::function<bool(const RigParameter&)>& belongs) {
  std::vector<Eigen::Index> rows;
  for (size_t i = 0; i < covariance.parameters.size(); ++i) {
    if (belongs(covariance.parameters[i])) rows.push_back(static_cast<Eigen::Index>(i));
  }
  if (rows.empty()) return {};
  const auto count = static_cast<Eigen::Index>(rows.size());
  Eigen::VectorXd error(count);
  Eigen::MatrixXd part(count, count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const Eigen::Index row = rows[static_cast<size_t>(i)];
    error[i] = ErrorOf(errors, covariance.parameters[static_cast<size_t>(row)]);
    for (Eigen::Index j = 0; j < count; ++j) {
      part(i, j) = covariance.matrix(row, rows[static_cast<size_t>(j)]);
    }
  }
  return NormalisedErrorSquared(error, part);
}

// Separates the scale of the poses from their shape, as CompareWithGroundTruth does: `along` is the
// direction in which a common scale moves them, `weights` gives the scale of the errors.
void FillPoses(const CalibrationErrors& errors, const RigCovariance& covariance, RigNees* nees) {
  std::vector<Eigen::Index> rows;
  for (size_t i = 0; i < covariance.parameters.size(); ++i) {
    const RigParameterKind kind = covariance.parameters[i].kind;
    if (kind == RigParameterKind::kRotation || kind == RigParameterKind::kPosition) {
      rows.push_back(static_cast<Eigen::Index>(i));
    }
  }
  if (rows.empty()) return;
  const auto count = static_cast<Eigen::Index>(rows.size());
  Eigen::VectorXd error(count), along = Eigen::VectorXd::Zero(count);
  Eigen::MatrixXd part(count, count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const Eigen::Index row = rows[static_cast<size_t>(i)];
    const RigParameter& parameter = covariance.parameters[static_cast<size_t>(row)];
    error[i] = ErrorOf(errors, parameter);
    if (parameter.kind == RigParameterKind::kPosition) {
      along[i] = ErrorOfCamera(errors, parameter.camera).true_position_m[parameter.component];
    }
    for (Eigen::Index j = 0; j < count; ++j) {
      part(i, j) = covariance.matrix(row, rows[static_cast<size_t>(j)]);
    }
  }
  const Eigen::VectorXd weights = along / along.squaredNorm();
  const double scale = weights.dot(error);
  nees->scale = {scale * scale / weights.dot(part * weights), 1};
  const Eigen::MatrixXd without =
      Eigen::MatrixXd::Identity(count, count) - along * weights.transpose();
  nees->shape = NormalisedErrorSquared(without * error, without * part * without.transpose());
}

// From the solver's parameters to RigParameter: positions of centres instead of translations.
struct ColumnMap {
  std::vector<RigParameter> parameters;
  Eigen::MatrixXd ours_from_solver;
};

ColumnMap MapColumns(const SimulatedWorld& world, const server::BundleProblem& problem,
                     const std::vector<ReducedParameter>& columns,
                     const std::vector<int>& camera_of_clock) {
  const auto size = static_cast<Eigen::Index>(columns.size());
  ColumnMap map;
  map.ours_from_solver = Eigen::MatrixXd::Zero(size, size);
  for (Eigen::Index i = 0; i < size; ++i) {
    const ReducedParameter& column = columns[static_cast<size_t>(i)];
    const auto index = static_cast<size_t>(column.index);
    const auto camera = [&] { return CameraIndex(world, problem.cameras[index].name); };
    map.ours_from_solver(i, i) = 1;
    switch (column.kind) {
      case ReducedParameterKind::kRotation:
        map.parameters.push_back({RigParameterKind::kRotation, camera(), column.component});
        break;
      case ReducedParameterKind::kTranslation:
        map.parameters.push_back({RigParameterKind::kPosition, camera(), column.component});
        break;
      case ReducedParameterKind::kIntrinsic:
        map.parameters.push_back({RigParameterKind::kIntrinsic, camera(), column.component});
        break;
      case ReducedParameterKind::kTimeOffset:
        map.parameters.push_back({RigParameterKind::kTimeOffset, camera_of_clock[index], 0});
        break;
      case ReducedParameterKind::kTimeRate:
        map.parameters.push_back({RigParameterKind::kTimeRate, camera_of_clock[index], 0});
        break;
      case ReducedParameterKind::kLineDelay:
        map.parameters.push_back({RigParameterKind::kLineDelay, camera(), 0});
        break;
      case ReducedParameterKind::kMarkerPosition:
        map.parameters.push_back({RigParameterKind::kMarkerPosition, column.index, 0});
        break;
      case ReducedParameterKind::kTargetPoint:  // of rigs with a wand alone
        break;
    }
  }
  // centre = -R^T t:  d centre = -R^T dt - R^T [t]x w  for R' = exp([w]x) R.
  for (Eigen::Index i = 0; i < size; ++i) {
    const ReducedParameter& to = columns[static_cast<size_t>(i)];
    if (to.kind != ReducedParameterKind::kTranslation) continue;
    const RigidTransform& pose = problem.cameras[static_cast<size_t>(to.index)].cam_from_rig;
    const Eigen::Matrix3d rig_from_cam = pose.rotation.toRotationMatrix().transpose();
    const Eigen::Vector3d& t = pose.translation_m;
    Eigen::Matrix3d cross;
    cross << 0, -t.z(), t.y(), t.z(), 0, -t.x(), -t.y(), t.x(), 0;
    const Eigen::Matrix3d by_rotation = -rig_from_cam * cross;
    for (Eigen::Index j = 0; j < size; ++j) {
      const ReducedParameter& from = columns[static_cast<size_t>(j)];
      if (from.index != to.index) continue;
      if (from.kind == ReducedParameterKind::kTranslation) {
        map.ours_from_solver(i, j) = -rig_from_cam(to.component, from.component);
      } else if (from.kind == ReducedParameterKind::kRotation) {
        map.ours_from_solver(i, j) = by_rotation(to.component, from.component);
      }
    }
  }
  return map;
}

}  // namespace

RigCovariance FromBound(const RigBound& bound, const InformationOptions& options) {
  RigCovariance covariance;
  covariance.matrix = bound.covariance;
  covariance.parameters.resize(static_cast<size_t>(bound.covariance.rows()));
  const auto put = [&covariance](int at, RigParameter parameter) {
    covariance.parameters[static_cast<size_t>(at)] = parameter;
  };
  for (int c = 0; c < bound.camera_count; ++c) {
    if (c != bound.reference_camera) {
      for (int i = 0; i < 3; ++i) {
        put(bound.PoseIndex(c) + i, {RigParameterKind::kRotation, c, i});
        put(bound.PoseIndex(c) + 3 + i, {RigParameterKind::kPosition, c, i});
      }
      if (options.time_offsets) {
        put(bound.TimeOffsetIndex(c), {RigParameterKind::kTimeOffset, c, 0});
      }
    }
    if (options.line_delays) {
      put(bound.first_line_delay + c, {RigParameterKind::kLineDelay, c, 0});
    }
    const int values = options.intrinsics ? static_cast<int>(options.intrinsics_sigma.size()) : 0;
    for (int i = 0; i < values; ++i) {
      put(bound.first_intrinsics + values * c + i, {RigParameterKind::kIntrinsic, c, i});
    }
  }
  for (int m = bound.first_marker_position; m < bound.first_time_offset; ++m) {
    put(m, {RigParameterKind::kMarkerPosition, m - bound.first_marker_position + 1, 0});
  }
  return covariance;
}

absl::StatusOr<RigCovariance> FromSolution(const SimulatedWorld& world,
                                           const server::RigSolution& solution,
                                           SolverCovariance which) {
  const server::BundleProblem& problem = solution.built.problem;
  RIGCAL_ASSIGN_OR_RETURN(const server::RigUncertainty stated,
                          server::ComputeUncertainty(solution, server::RigSolveOptions{}));
  std::vector<int> camera_of_clock;
  for (const server::BundleClock& clock : problem.clocks) {
    camera_of_clock.push_back(CameraIndex(world, clock.clock_id));
  }
  ColumnMap map = MapColumns(world, problem, stated.parameters, camera_of_clock);
  const Eigen::MatrixXd& covariance =
      which == SolverCovariance::kStated ? stated.covariance : stated.noise_covariance;
  return RigCovariance{std::move(map.parameters),
                       map.ours_from_solver * covariance * map.ours_from_solver.transpose()};
}

RigNees NormaliseErrors(const CalibrationErrors& errors, const RigCovariance& covariance) {
  const auto part = [&](RigParameterKind kind) {
    return Part(errors, covariance,
                [kind](const RigParameter& parameter) { return parameter.kind == kind; });
  };
  RigNees nees;
  FillPoses(errors, covariance, &nees);
  nees.marker_positions = part(RigParameterKind::kMarkerPosition);
  nees.time_offsets = part(RigParameterKind::kTimeOffset);
  nees.time_rates = part(RigParameterKind::kTimeRate);
  nees.line_delays = part(RigParameterKind::kLineDelay);
  nees.intrinsics = part(RigParameterKind::kIntrinsic);
  return nees;
}

}  // namespace rigcal::accuracy
