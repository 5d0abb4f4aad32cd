// SPDX-License-Identifier: Apache-2.0
#include "server/solve/diagnose/trial_solve.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "common/statistics/robust_statistics.h"
#include "common/status/status_macros.h"
#include "server/solve/bundle/bundle_path.h"
#include "server/solve/bundle/marker_residual_px.h"
#include "server/solve/evaluate/placed_views.h"
#include "server/solve/rig/outliers.h"

namespace rigcal::server {
namespace {

constexpr size_t kMaxObservations = 40'000;
constexpr size_t kMaxGeneralMarkers = 20'000;  // of the general path, which is slower
constexpr int kMaxRounds = 4;
constexpr double kWideLoss = 20;
constexpr double kUnseenPx = 100;

// Of the markers of placed instants; NaN of others.
std::vector<double> ErrorsPx(const BundleProblem& problem) {
  std::vector<double> errors(problem.markers.size(), std::numeric_limits<double>::quiet_NaN());
  ForEachMarker(problem, [&](size_t i, const BundleObservation& observation, size_t m) {
    const auto residual =
        MarkerResidualPx(problem, problem.instants[i], observation, problem.markers[m]);
    errors[m] = residual ? residual->norm() : kUnseenPx;
  });
  return errors;
}

// Robust variance of the whitened residuals, never less than one.
double VarianceFactor(const BundleProblem& problem) {
  std::vector<double> norms;
  ForEachMarker(problem, [&](size_t i, const BundleObservation& observation, size_t m) {
    const BundleMarker& marker = problem.markers[m];
    const auto residual = MarkerResidualPx(problem, problem.instants[i], observation, marker);
    if (marker.used && residual) norms.push_back((marker.sqrt_information * *residual).norm());
  });
  if (norms.empty()) return 1;
  const double scale = UpperMedian(&norms) / kMedianOfRayleigh;
  return std::max(1.0, scale * scale);
}

// The intrinsics of camera `b` become those of camera `a`.
void ShareLens(int a, int b, ReducedInformation* reduced) {
  std::vector<ReducedParameter> kept;
  std::vector<Eigen::Index> column;
  const auto row_of = [&kept](const ReducedParameter& parameter) {
    return std::find(kept.begin(), kept.end(), parameter) - kept.begin();
  };
  for (const ReducedParameter& parameter : reduced->parameters) {
    if (parameter.kind != ReducedParameterKind::kIntrinsic || parameter.index != b) {
      kept.push_back(parameter);
    }
  }
  const auto size = static_cast<Eigen::Index>(kept.size());
  Eigen::MatrixXd of_kept =
      Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(reduced->parameters.size()), size);
  for (size_t i = 0; i < reduced->parameters.size(); ++i) {
    ReducedParameter parameter = reduced->parameters[i];
    if (parameter.kind == ReducedParameterKind::kIntrinsic && parameter.index == b) {
      parameter.index = a;
    }
    const Eigen::Index own = row_of(parameter);
    if (own < size) of_kept(static_cast<Eigen::Index>(i), own) = 1;
  }
  reduced->information = of_kept.transpose() * reduced->information * of_kept;
  reduced->parameters = std::move(kept);
}

// Of sums.
void TakeMean(ErrorChange* change) {
  change->before_px /= std::max(1, change->marker_count);
  change->after_px /= std::max(1, change->marker_count);
}

}  // namespace

TrialProblem MakeTrialProblem(const RigSolution& solution, const RigSolveOptions& options) {
  const BundleProblem& from = solution.built.problem;
  TrialProblem trial;
  trial.bundle.function_tolerance = 1e-7;
  trial.bundle.max_iterations = 50;
  trial.bundle.cancelled = options.cancelled;
  trial.problem.cameras = from.cameras;
  trial.problem.clocks = from.clocks;
  trial.problem.target = from.target;
  trial.problem.rigid_target = from.rigid_target;
  trial.problem.distance = from.distance;
  for (size_t c = 0; c < from.cameras.size(); ++c) trial.rig_camera.push_back(c);
  size_t stride = 1 + from.observations.size() / kMaxObservations;
  if (from.HasRigidTarget()) stride += from.markers.size() / kMaxGeneralMarkers;
  size_t placed = 0;
  for (size_t i = 0; i < from.instants.size(); ++i) {
    if (!from.instants[i].used || placed++ % stride != 0) continue;
    BundleInstant instant = from.instants[i];
    instant.first_observation = static_cast<int>(trial.problem.observations.size());
    for (BundleObservation observation : from.ObservationsOf(from.instants[i])) {
      const auto markers = from.MarkersOf(observation);
      observation.first_marker = static_cast<int>(trial.problem.markers.size());
      trial.problem.markers.insert(trial.problem.markers.end(), markers.begin(), markers.end());
      trial.problem.observations.push_back(observation);
    }
    trial.problem.instants.push_back(instant);
    trial.instant_time_ns.push_back(solution.built.instant_time_ns[i]);
  }
  trial.shares_few = LooksAtLensesAlone(trial.problem);
  return trial;
}

void UseSome(size_t max_observations, BundleProblem* problem) {
  std::vector<size_t> views(problem->cameras.size(), 0);
  size_t all = 0;
  for (const BundleInstant& instant : problem->instants) {
    if (!instant.used) continue;
    for (const BundleObservation& observation : problem->ObservationsOf(instant)) {
      ++views[static_cast<size_t>(observation.camera)];
      ++all;
    }
  }
  const size_t share = max_observations / std::max<size_t>(1, views.size());
  const size_t stride = 1 + all / std::max<size_t>(1, max_observations);
  size_t placed = 0;
  for (BundleInstant& instant : problem->instants) {
    if (!instant.used) continue;
    const bool is_next = placed++ % stride == 0;
    instant.used =
        is_next || std::ranges::any_of(
                       problem->ObservationsOf(instant), [&](const BundleObservation& observation) {
                         return views[static_cast<size_t>(observation.camera)] < share;
                       });
  }
}

absl::Status SolveTrial(const BundleOptions& how, BundleProblem* problem) {
  for (int round = 0; round < kMaxRounds; ++round) {
    RIGCAL_RETURN_IF_ERROR(AdjustBundle(how, problem).status());
    if (ClassifyOutliers(problem) == 0) break;
  }
  return absl::OkStatus();
}

absl::Status SolveTrialFromAfar(const BundleOptions& how, BundleProblem* problem) {
  BundleOptions wide = how;
  wide.loss_scale *= kWideLoss;
  RIGCAL_RETURN_IF_ERROR(SolveTrial(wide, problem));
  return SolveTrial(how, problem);
}

std::vector<ErrorChange> CompareErrors(const BundleProblem& before, const BundleProblem& after) {
  const std::vector<double> before_px = ErrorsPx(before), after_px = ErrorsPx(after);
  std::vector<ErrorChange> changes(before.cameras.size());
  ForEachMarker(before, [&](size_t, const BundleObservation& observation, size_t m) {
    if (!before.markers[m].used && !after.markers[m].used) return;
    ErrorChange& change = changes[static_cast<size_t>(observation.camera)];
    change.before_px += before_px[m];
    // Where the instant lost its place nothing is known to have changed.
    change.after_px += std::isnan(after_px[m]) ? before_px[m] : after_px[m];
    ++change.marker_count;
  });
  for (ErrorChange& change : changes) TakeMean(&change);
  return changes;
}

double CappedErrorPx(const BundleProblem& problem, double cap_px) {
  double sum_px = 0;
  const std::vector<double> errors_px = ErrorsPx(problem);
  for (const double error_px : errors_px) {
    sum_px += std::isnan(error_px) ? cap_px : std::min(error_px, cap_px);
  }
  return sum_px / std::max(1.0, static_cast<double>(errors_px.size()));
}

ErrorChange Overall(const std::vector<ErrorChange>& changes) {
  ErrorChange all;
  for (const ErrorChange& change : changes) {
    all.before_px += change.before_px * change.marker_count;
    all.after_px += change.after_px * change.marker_count;
    all.marker_count += change.marker_count;
  }
  TakeMean(&all);
  return all;
}

Eigen::Index TrialSigmas::Row(const ReducedParameter& parameter) const {
  const auto found = std::find(parameters.begin(), parameters.end(), parameter);
  return found == parameters.end() ? -1 : found - parameters.begin();
}

double TrialSigmas::Of(const ReducedParameter& parameter) const {
  const Eigen::Index row = Row(parameter);
  const double own = row < 0 ? 0 : variance[row];
  return own > 0 ? std::sqrt(own) : std::numeric_limits<double>::infinity();
}

double TrialSigmas::PoseDistance(int a, int b,
                                 const Eigen::Matrix<double, 6, 1>& difference) const {
  // The difference by parameter: +1 for those of b, -1 for those of a; a fixed pose has none.
  Eigen::MatrixXd by_parameter = Eigen::MatrixXd::Zero(unit.size(), 6);
  for (int i = 0; i < 6; ++i) {
    const auto kind = i < 3 ? ReducedParameterKind::kRotation : ReducedParameterKind::kTranslation;
    const Eigen::Index row_a = Row({kind, a, i % 3}), row_b = Row({kind, b, i % 3});
    if (row_a >= 0) by_parameter(row_a, i) = -unit[row_a];
    if (row_b >= 0) by_parameter(row_b, i) = unit[row_b];
  }
  information.SolveLowerInPlace(&by_parameter);
  const Eigen::Matrix<double, 6, 6> spread = factor * by_parameter.transpose() * by_parameter;
  // Radians beside metres: scaled before they are inverted.
  const Eigen::Matrix<double, 6, 1> scale = spread.diagonal().cwiseSqrt().cwiseInverse();
  if (!scale.allFinite()) return 0;
  const Eigen::Matrix<double, 6, 6> scaled = scale.asDiagonal() * spread * scale.asDiagonal();
  const Eigen::Matrix<double, 6, 1> whole = scale.cwiseProduct(difference);
  const double squared = whole.dot(scaled.ldlt().solve(whole));
  return squared > 0 && std::isfinite(squared) ? std::sqrt(squared) : 0;
}

absl::StatusOr<TrialSigmas> ComputeSigmas(const BundleOptions& how, const BundleProblem& problem,
                                          std::optional<std::pair<int, int>> one_lens) {
  RIGCAL_ASSIGN_OR_RETURN(ReducedInformation reduced, ComputeInformation(how, problem));
  if (one_lens) ShareLens(one_lens->first, one_lens->second, &reduced);
  // Columns differ by many powers of ten (radians beside pixels): scaled before they are inverted.
  const Eigen::VectorXd scale =
      reduced.information.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * reduced.information * scale.asDiagonal();
  EnvelopeCholesky information(scaled);
  if (!information.ok()) {
    return absl::FailedPreconditionError("the information is not positive definite");
  }
  const double factor = VarianceFactor(problem);
  Eigen::VectorXd variance =
      factor * scale.cwiseAbs2().cwiseProduct(information.InverseWithin().Diagonal());
  return TrialSigmas{std::move(reduced.parameters), std::move(variance), std::move(information),
                     scale, factor};
}

}  // namespace rigcal::server
