// SPDX-License-Identifier: Apache-2.0
#include "server/solve/trajectory/trajectory_adjuster.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "common/statistics/robust_statistics.h"
#include "common/status/status_macros.h"
#include "server/solve/bundle/target_scale.h"
#include "server/solve/trajectory/trajectory_system.h"

namespace rigcal::server {
namespace {

constexpr double kSettled = 0.04;      // relative change of a sigma
constexpr double kMaxSigmaStep = 10;   // by which factor a sigma may change at once
constexpr double kSettledCost = 1e-3;  // of a stage before the sigmas have settled, relative
constexpr double kOutlierSigmas = 8, kMinScale = 1;
// Centres are not better than stated by more than this: exact ones would need a path without prior.
constexpr double kMinResidualSigma = 0.01;
constexpr double kMinFreedom = 0.05;  // of the residuals, by number

std::vector<double> UsedNorms(const TrajectoryProblem& problem) {
  std::vector<double> norms;
  ForEachUsedMarkerOfRows(
      problem, [&](size_t row, const BundleObservation& observation, const BundleMarker& marker) {
        const auto residual = problem.WhitenedResidual(row, observation, marker);
        if (residual) norms.push_back(residual->norm());
      });
  return norms;
}

// Towards sqrt(square / by_data) in the residuals' unit; returns the relative change.
double UpdateSigma(double square, double by_data, double variance, double* sigma) {
  if (!(by_data > 0) || !(square > 0) || !(variance > 0)) return 0;
  const double wanted = std::sqrt(square / by_data / variance);
  const double factor = std::clamp(wanted / *sigma, 1 / kMaxSigmaStep, kMaxSigmaStep);
  *sigma *= factor;
  return std::abs(std::log(factor));
}

// As SettleScale, the path with the rest: in units of the wand it is the same path.
double SettleScaleOfPath(TrajectoryProblem* problem) {
  const SettledScale settled = SettleScale(&problem->rows);
  problem->origin_sigma *= settled.factor;
  for (TrajectorySpan& span : problem->spans) {
    for (Eigen::Index k = 0; k < span.knot_count(); ++k) {
      auto origin_m = span.knots.segment<3>(k * span.size);
      origin_m = (settled.centre_m + settled.factor * (origin_m - settled.centre_m)).eval();
    }
  }
  return settled.gain;
}

}  // namespace

absl::StatusOr<TrajectorySummary> AdjustTrajectory(const BundleOptions& options,
                                                   TrajectoryProblem* problem) {
  RIGCAL_RETURN_IF_ERROR(options.Validate());
  RIGCAL_RETURN_IF_ERROR(problem->Validate());
  if (UsedNorms(*problem).empty()) {
    return absl::FailedPreconditionError("trajectory: no marker is used");
  }
  TrajectorySystem system(options, problem);
  TrajectorySummary summary;
  bool sigmas_settled = false;
  double last_cost = std::numeric_limits<double>::infinity();
  while (summary.iterations < options.max_iterations) {
    if (options.cancelled != nullptr && options.cancelled->load()) {
      return absl::CancelledError("the calibration was cancelled");
    }
    if (!system.Linearise()) {
      return absl::FailedPreconditionError(
          "trajectory: a marker is not visible from its camera, or the data do not determine the "
          "path");
    }
    if (summary.iterations == 0) summary.initial_cost = system.cost();
    if (options.progress) options.progress(summary.iterations, system.cost());
    const double gain = (last_cost - system.cost()) / std::max(system.cost(), 1e-300);
    if (!sigmas_settled && gain < kSettledCost) {
      system.PreparePathCovariance();
      const PathFreedom freedom = system.MeasureFreedom();
      std::vector<double> norms = UsedNorms(*problem);
      const double numbers = 2 * static_cast<double>(norms.size());
      const double taken = freedom.values + system.layout().column_count();
      const double scale = UpperMedian(&norms) / kMedianOfRayleigh;
      const double variance = std::max(kMinResidualSigma * kMinResidualSigma,
                                       scale * scale / std::max(kMinFreedom, 1 - taken / numbers));
      summary.residual_sigma = std::sqrt(variance);
      summary.path_freedom = freedom.values;
      const double origin = UpdateSigma(freedom.origin_square, freedom.origin_by_data, variance,
                                        &problem->origin_sigma);
      const double direction = UpdateSigma(freedom.direction_square, freedom.direction_by_data,
                                           variance, &problem->direction_sigma);
      sigmas_settled = std::max(origin, direction) < kSettled;
      system.CountPaths(variance);
      last_cost = std::numeric_limits<double>::infinity();
      if (!system.Linearise()) return absl::InternalError("trajectory: the path broke down");
    } else if (sigmas_settled && gain < options.function_tolerance) {
      summary.converged = true;
      break;
    }
    last_cost = system.cost();
    ++summary.iterations;
    const TrajectorySystem::StepOutcome outcome = system.Step();
    if (outcome != TrajectorySystem::StepOutcome::kTaken) {
      if (sigmas_settled) {
        summary.converged = outcome == TrajectorySystem::StepOutcome::kNoGain;
        break;
      }
      last_cost = system.cost();  // at the optimum of these sigmas
    }
  }
  summary.final_cost = system.cost() - SettleScaleOfPath(problem);
  return summary;
}

int ClassifyOutliersOfPath(const BundleOptions& options, TrajectoryProblem* problem) {
  TrajectorySystem system(options, problem);
  if (!system.Linearise()) return 0;
  system.PreparePathCovariance();
  BundleProblem& rows = problem->rows;
  struct Seen {
    size_t marker;
    int camera;
    double norm;       // whitened by the centre's covariance; infinite where it cannot be seen
    double path_norm;  // by that and the path's
  };
  std::vector<Seen> seen;
  std::vector<std::vector<double>> norms(rows.cameras.size());
  for (size_t row = 0; row < rows.instants.size(); ++row) {
    if (problem->span_of_row[row] < 0) continue;
    for (const BundleObservation& observation : rows.ObservationsOf(rows.instants[row])) {
      for (const BundleMarker& marker : rows.MarkersOf(observation)) {
        const auto residual = problem->WhitenedResidual(row, observation, marker);
        Seen one{rows.IndexOf(marker), observation.camera, std::numeric_limits<double>::infinity(),
                 std::numeric_limits<double>::infinity()};
        if (residual) {
          one.norm = residual->norm();
          if (marker.used) norms[static_cast<size_t>(observation.camera)].push_back(one.norm);
          // The path knows of a used marker already.
          const Eigen::Matrix2d covariance =
              Eigen::Matrix2d::Identity() + (marker.used
                                                 ? Eigen::Matrix2d(Eigen::Matrix2d::Zero())
                                                 : system.PathCovariance(row, observation, marker));
          one.path_norm = std::sqrt(residual->dot(covariance.inverse() * *residual));
        }
        seen.push_back(one);
      }
    }
  }
  std::vector<double> limits;
  for (std::vector<double>& own : norms) {
    const double scale = own.empty() ? 0 : UpperMedian(&own) / kMedianOfRayleigh;
    limits.push_back(kOutlierSigmas * std::max(kMinScale, scale));
  }
  int changed = 0;
  for (const Seen& one : seen) {
    const bool used = one.path_norm <= limits[static_cast<size_t>(one.camera)];
    changed += used != rows.markers[one.marker].used ? 1 : 0;
    rows.markers[one.marker].used = used;
  }
  return changed;
}

}  // namespace rigcal::server
