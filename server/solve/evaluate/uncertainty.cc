// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/uncertainty.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "common/status/status_macros.h"
#include "server/solve/bundle/bundle_path.h"
#include "server/solve/bundle/envelope_cholesky.h"
#include "server/solve/evaluate/attached_point.h"
#include "server/solve/evaluate/block_scatter.h"
#include "server/solve/evaluate/held_uncertainty.h"
#include "server/solve/evaluate/loss_factors.h"
#include "server/solve/evaluate/prior_information.h"
#include "server/solve/evaluate/scale_uncertainty.h"
#include "server/solve/rig/trajectory_fit.h"
#include "server/solve/trajectory/trajectory_system.h"

namespace rigcal::server {
namespace {

// Of rows whose errors may have something in common, as in block_scatter.h.
constexpr int64_t kPathBlockNs = 2'000'000'000;

// Symmetric inverse by Cholesky of the matrix with a unit diagonal: parameters of very different
// units share it.
absl::StatusOr<Eigen::MatrixXd> Inverse(const Eigen::MatrixXd& information) {
  const Eigen::VectorXd diagonal = information.diagonal();
  if (!(diagonal.minCoeff() > 0)) {
    return absl::InternalError("uncertainty: a parameter is not determined by the data");
  }
  const Eigen::VectorXd scale = diagonal.cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * information * scale.asDiagonal();
  const EnvelopeCholesky factor(scaled);
  if (!factor.ok()) {
    return absl::InternalError("uncertainty: the parameters are not determined by the data");
  }
  const Eigen::MatrixXd inverse = factor.Inverse();
  if (!inverse.allFinite()) return absl::InternalError("uncertainty: not finite");
  return Eigen::MatrixXd(scale.asDiagonal() * inverse * scale.asDiagonal());
}

// Takes the scatter of the blocks for what their errors have in common; uncertainty.h says how.
void AllowForCommonErrors(const BlockScatter& scatter, const Eigen::MatrixXd& prior,
                          RigUncertainty* rig) {
  rig->design_effect = scatter.design_effect;
  rig->noise_covariance = rig->covariance;
  if (scatter.block_count() == 0 || !(scatter.design_effect > 1)) return;
  const double kept = 1 / std::sqrt(scatter.design_effect);
  // Most parameters have no prior.
  std::vector<Eigen::Index> rows;
  for (Eigen::Index i = 0; i < prior.rows(); ++i) {
    if ((prior.col(i).array() != 0).any()) rows.push_back(i);
  }
  Eigen::MatrixXd by_blocks = scatter.changes * scatter.changes.transpose();
  if (!rows.empty()) {
    by_blocks.noalias() += rig->covariance(Eigen::all, rows) *
                           (prior(rows, rows) * rig->covariance(rows, Eigen::all)).eval();
  }
  rig->covariance = kept * rig->covariance + (1 - kept) * by_blocks;
}

// Rows of the uncertainty, -1 for none, in the packed order.
std::vector<Eigen::Index> RowsOf(const BundleProblem& problem, int reference_camera,
                                 const RigUncertainty& uncertainty) {
  std::vector<Eigen::Index> rows;
  const auto add = [&](ReducedParameterKind kind, int camera, int component) {
    rows.push_back(uncertainty.Row({kind, camera, component}));
  };
  for (int c = 0; c < static_cast<int>(problem.cameras.size()); ++c) {
    const BundleCamera& camera = problem.cameras[static_cast<size_t>(c)];
    if (c != reference_camera) {
      for (int i = 0; i < 3; ++i) add(ReducedParameterKind::kRotation, c, i);
      for (int i = 0; i < 3; ++i) add(ReducedParameterKind::kTranslation, c, i);
    }
    if (camera.intrinsics_fixed) continue;
    for (int i = 0; i < static_cast<int>(camera.intrinsics.size()); ++i) {
      add(ReducedParameterKind::kIntrinsic, c, i);
    }
  }
  return rows;
}

CameraUncertainty OfCamera(const BundleProblem& problem, int index, const RigUncertainty& rig) {
  const BundleCamera& camera = problem.cameras[static_cast<size_t>(index)];
  CameraUncertainty result;
  const Eigen::Index rotation = rig.Row({ReducedParameterKind::kRotation, index, 0});
  if (rotation >= 0) {
    for (int i = 0; i < 3; ++i) {
      const Eigen::Index w = rig.Row({ReducedParameterKind::kRotation, index, i});
      result.rotation_sigma_rad[i] = std::sqrt(std::max(0.0, rig.shape_covariance(w, w)));
    }
    const PointGainMatrix gain =
        AttachedPointGain(problem, rig, index, camera.cam_from_rig.SourceFromTargetTranslation());
    const std::vector<Eigen::Index> rows = PoseRows(rig, index);
    const Eigen::MatrixXd own = gain(Eigen::all, rows);
    result.position_sigma_m = (own * rig.shape_covariance(rows, rows) * own.transpose())
                                  .diagonal()
                                  .cwiseMax(0)
                                  .cwiseSqrt();
  }
  if (camera.intrinsics_fixed) return result;
  for (int i = 0; i < static_cast<int>(camera.intrinsics.size()); ++i) {
    const Eigen::Index row = rig.Row({ReducedParameterKind::kIntrinsic, index, i});
    result.intrinsics_sigma.push_back(
        row < 0 ? 0 : std::sqrt(std::max(0.0, rig.shape_covariance(row, row))));
  }
  return result;
}

void DescribeMarkerPositions(const BundleProblem& problem, RigUncertainty* rig) {
  const int count = static_cast<int>(problem.target.marker_positions_m.size());
  for (int m = 0; m < count; ++m) {
    const Eigen::Index own = rig->Row({ReducedParameterKind::kMarkerPosition, m, 0});
    rig->marker_position_sigma_m.push_back(own < 0 ? 0 : std::sqrt(rig->covariance(own, own)));
  }
}

absl::Status DescribeByInstants(const RigSolution& solution, bool with_blocks,
                                RigUncertainty* result) {
  const BundleProblem& problem = solution.built.problem;
  const BundleOptions bundle;
  RIGCAL_ASSIGN_OR_RETURN(const ReducedInformation information,
                          ComputeInformation(bundle, problem));
  result->parameters = information.parameters;
  const Eigen::MatrixXd prior = PriorInformation(problem, result->parameters);
  const LossFactors loss =
      MeasureLossFactors(solution.built, bundle.loss_scale, information.information.rows());
  RIGCAL_ASSIGN_OR_RETURN(result->covariance,
                          Inverse((information.information - prior) / loss.variance + prior));
  result->noise_covariance = result->covariance;
  if (!with_blocks) return absl::OkStatus();
  AllowForCommonErrors(
      MeasureBlockScatter(solution.built, bundle, result->parameters, result->covariance, loss),
      prior, result);
  return absl::OkStatus();
}

// Every residual's leverage is the mean one: some are of rows that nobody else shares, which the
// path follows, but they say little.
absl::Status DescribeByPath(const TrajectoryFit& fit, RigUncertainty* result) {
  TrajectoryProblem problem = fit.problem;
  const BundleOptions bundle;
  TrajectorySystem system(bundle, &problem);
  if (!system.Linearise()) return absl::InternalError("uncertainty: the path is not determined");
  result->parameters = system.layout().parameters;
  const Eigen::MatrixXd information = system.matrix().selfadjointView<Eigen::Lower>();
  const Eigen::MatrixXd prior = PriorInformation(problem.rows, result->parameters);
  system.PreparePathCovariance();
  const double free = system.MeasureFreedom().values + static_cast<double>(information.rows());
  LossSum counted(bundle.loss_scale);
  ForEachUsedMarkerOfRows(
      problem, [&](size_t row, const BundleObservation& observation, const BundleMarker& marker) {
        if (problem.WhitenedResidual(row, observation, marker)) counted.Add(0, 1, 0);
      });
  const double leverage = std::min(kMaxLeverage, free / std::max(1.0, 2 * counted.count()));
  LossSum sum(bundle.loss_scale);
  std::map<int64_t, BlockInformation> blocks;
  system.ForEachReduced([&](size_t row, double weight, const Eigen::Vector2d& residual,
                            const Eigen::Matrix<double, 2, Eigen::Dynamic>& slope) {
    sum.Add(residual.squaredNorm(), 1, leverage);
    BlockInformation& block = blocks[fit.row_time_ns[row] / kPathBlockNs];
    if (block.score.size() == 0) {
      block.rows.resize(static_cast<size_t>(slope.cols()));
      std::iota(block.rows.begin(), block.rows.end(), Eigen::Index{0});
      block.information = Eigen::MatrixXd::Zero(slope.cols(), slope.cols());
      block.score = Eigen::VectorXd::Zero(slope.cols());
    }
    block.information.noalias() += weight * slope.transpose() * slope;
    block.score.noalias() -= weight * slope.transpose() * residual;
  });
  const LossFactors loss = sum.Factors(free);
  RIGCAL_ASSIGN_OR_RETURN(result->covariance,
                          Inverse((information - prior) / loss.variance + prior));
  BlockScatterSum scatter(result->covariance, loss);
  for (const auto& [number, block] : blocks) scatter.Add(block);
  AllowForCommonErrors(scatter.Finish(), prior, result);
  return absl::OkStatus();
}

}  // namespace

Eigen::Index RigUncertainty::Row(const ReducedParameter& parameter) const {
  const auto found = std::find(parameters.begin(), parameters.end(), parameter);
  return found == parameters.end() ? -1 : found - parameters.begin();
}

double RigUncertainty::ClockSigma(ReducedParameterKind kind,
                                  const std::vector<double>& weights) const {
  // Two clocks are compared with each other for every pair of a large rig.
  std::vector<Eigen::Index> rows;
  std::vector<double> values;
  for (size_t k = 0; k < weights.size(); ++k) {
    const Eigen::Index own = weights[k] == 0 ? -1 : Row({kind, static_cast<int>(k), 0});
    if (own < 0) continue;
    rows.push_back(own);
    values.push_back(weights[k]);
  }
  double variance = 0;
  for (size_t i = 0; i < rows.size(); ++i) {
    double along = 0;
    for (size_t j = 0; j < rows.size(); ++j) along += covariance(rows[i], rows[j]) * values[j];
    variance += values[i] * along;
  }
  return std::sqrt(std::max(0.0, variance));
}

void DescribeCameras(const BundleProblem& problem, RigUncertainty* uncertainty) {
  uncertainty->cameras.clear();
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    uncertainty->cameras.push_back(OfCamera(problem, static_cast<int>(c), *uncertainty));
  }
}

std::vector<double> PackCameraCovariance(const BundleProblem& problem, int reference_camera,
                                         const RigUncertainty& uncertainty) {
  const std::vector<Eigen::Index> rows = RowsOf(problem, reference_camera, uncertainty);
  std::vector<double> packed;
  packed.reserve(rows.size() * (rows.size() + 1) / 2);
  for (size_t i = 0; i < rows.size(); ++i) {
    for (size_t j = 0; j <= i; ++j) {
      packed.push_back(rows[i] < 0 || rows[j] < 0 ? 0
                                                  : uncertainty.shape_covariance(rows[i], rows[j]));
    }
  }
  return packed;
}

absl::StatusOr<RigUncertainty> ComputeNoiseUncertainty(const RigSolution& solution) {
  RigUncertainty result;
  RIGCAL_RETURN_IF_ERROR(DescribeByInstants(solution, false, &result));
  return result;
}

absl::StatusOr<RigUncertainty> ComputeUncertainty(const RigSolution& solution,
                                                  const RigSolveOptions& options) {
  const BundleProblem& problem = solution.built.problem;
  RigUncertainty result;
  if (solution.trajectory != nullptr) {
    RIGCAL_RETURN_IF_ERROR(DescribeByPath(*solution.trajectory, &result));
  } else {
    RIGCAL_RETURN_IF_ERROR(DescribeByInstants(solution, true, &result));
  }
  DescribeScale(problem, options.known_distance_sigma_m, &result);
  if (!problem.distance) DescribeMarkerPositions(problem, &result);
  if (options.held != nullptr) {
    RIGCAL_RETURN_IF_ERROR(AddHeldUncertainty(solution, *options.held, &result));
  }
  DescribeCameras(problem, &result);
  return result;
}

}  // namespace rigcal::server
