// SPDX-License-Identifier: Apache-2.0
#include "server/solve/rig/line_delays.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "common/statistics/robust_statistics.h"
#include "common/status/status_macros.h"
#include "server/solve/bundle/bundle_path.h"
#include "server/solve/bundle/marker_residual_px.h"

namespace rigcal::server {
namespace {

constexpr double kLineDelayTolerance = 1e-9;  // relative change of the cost

double MiddleRow(const RigObservations& rig, int camera) {
  return 0.5 * (rig.index.cameras[static_cast<size_t>(camera)].image_size_px.height - 1.0);
}

// A problem whose clocks run with the image rows.
struct RowClockProblem {
  BundleProblem problem;
  std::vector<int> camera_of_clock;
};

// Every marker becomes an observation of its own, at the time of its row of a clock of its camera.
RowClockProblem MakeRowClockProblem(const RigObservations& rig, const BundleProblem& from) {
  RowClockProblem result{from, {}};
  BundleProblem& problem = result.problem;
  problem.clocks.clear();
  problem.observations.clear();
  problem.observations.reserve(from.markers.size());
  std::map<std::pair<int, int>, int> clock_of;  // by camera and clock
  for (BundleInstant& instant : problem.instants) {
    const auto observations = from.ObservationsOf(instant);
    instant.first_observation = static_cast<int>(problem.observations.size());
    for (BundleObservation observation : observations) {
      const auto [entry, inserted] = clock_of.try_emplace({observation.camera, observation.clock},
                                                          static_cast<int>(problem.clocks.size()));
      if (inserted) {
        BundleClock clock = from.clocks[static_cast<size_t>(observation.clock)];
        clock.time_rate = clock.prior_rate = clock.rate_sigma = 0;
        clock.rate_fixed = false;
        problem.clocks.push_back(std::move(clock));
        result.camera_of_clock.push_back(observation.camera);
      }
      observation.clock = entry->second;
      const double middle = MiddleRow(rig, observation.camera);
      const int first_marker = observation.first_marker, count = observation.marker_count;
      for (int m = first_marker; m < first_marker + count; ++m) {
        observation.first_marker = m;
        observation.marker_count = 1;
        observation.clock_time_s = from.markers[static_cast<size_t>(m)].centre_px.y() - middle;
        problem.observations.push_back(observation);
      }
    }
    instant.observation_count =
        static_cast<int>(problem.observations.size()) - instant.first_observation;
  }
  // A problem wants a clock that is wholly fixed; nothing is stamped by this one.
  problem.clocks.emplace_back();
  return result;
}

void ThinOutInstants(size_t max_markers, BundleProblem* problem) {
  if (max_markers == 0) return;
  const size_t stride = 1 + problem->markers.size() / max_markers;
  for (size_t i = 0; i < problem->instants.size(); ++i) {
    BundleInstant& instant = problem->instants[i];
    instant.used = instant.used && i % stride == 0;
  }
}

// Robust variance of the whitened residuals, never less than one.
double ResidualVariance(const BundleProblem& problem) {
  std::vector<double> norms;
  for (const BundleInstant& instant : problem.instants) {
    ForEachUsedMarker(
        problem, instant, [&](const BundleObservation& observation, const BundleMarker& marker) {
          const auto residual = MarkerResidualPx(problem, instant, observation, marker);
          if (residual) norms.push_back((marker.sqrt_information * *residual).norm());
        });
  }
  if (norms.empty()) return 1;
  const double scale = UpperMedian(&norms) / kMedianOfRayleigh;
  return std::max(1.0, scale * scale);
}

// Sigmas of the rates, by clock; 0 for none.
absl::StatusOr<std::vector<double>> RateSigmas(const BundleOptions& options,
                                               const BundleProblem& problem) {
  RIGCAL_ASSIGN_OR_RETURN(const ReducedInformation reduced, ComputeInformation(options, problem));
  const Eigen::VectorXd scale =
      reduced.information.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const Eigen::LDLT<Eigen::MatrixXd> factor(scale.asDiagonal() * reduced.information *
                                            scale.asDiagonal());
  if (factor.info() != Eigen::Success || !factor.isPositive()) {
    return absl::FailedPreconditionError("line delays: not determined by the data");
  }
  const Eigen::Index size = reduced.information.rows();
  const double variance = ResidualVariance(problem);
  std::vector<double> sigmas(problem.clocks.size(), 0);
  for (Eigen::Index i = 0; i < size; ++i) {
    const ReducedParameter& parameter = reduced.parameters[static_cast<size_t>(i)];
    if (parameter.kind != ReducedParameterKind::kTimeRate) continue;
    const double square = factor.solve(Eigen::VectorXd::Unit(size, i))[i] * scale[i] * scale[i];
    if (square > 0) sigmas[static_cast<size_t>(parameter.index)] = std::sqrt(variance * square);
  }
  return sigmas;
}

}  // namespace

absl::StatusOr<LineDelayEstimate> EstimateLineDelays(const RigObservations& rig,
                                                     const RigSolveOptions& options,
                                                     const RigSolution& solution,
                                                     size_t max_markers) {
  RowClockProblem rows = MakeRowClockProblem(rig, solution.built.problem);
  ThinOutInstants(max_markers, &rows.problem);
  BundleOptions bundle;
  bundle.function_tolerance = kLineDelayTolerance;
  bundle.cancelled = options.cancelled;
  RIGCAL_ASSIGN_OR_RETURN(const BundleSummary summary, AdjustBundle(bundle, &rows.problem));
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<double> sigmas, RateSigmas(bundle, rows.problem));
  LineDelayEstimate estimate;
  estimate.cameras.resize(rig.index.cameras.size());
  if (summary.initial_cost > 0) estimate.cost_share = 1 - summary.final_cost / summary.initial_cost;
  // A camera with several clocks has one line delay: the mean by their weights.
  std::vector<double> weights(estimate.cameras.size(), 0);
  for (size_t k = 0; k < rows.camera_of_clock.size(); ++k) {
    if (!(sigmas[k] > 0)) continue;
    const auto c = static_cast<size_t>(rows.camera_of_clock[k]);
    const double weight = 1 / (sigmas[k] * sigmas[k]);
    estimate.cameras[c].line_delay_s += weight * rows.problem.clocks[k].time_rate;
    weights[c] += weight;
  }
  for (size_t c = 0; c < weights.size(); ++c) {
    if (!(weights[c] > 0)) continue;
    estimate.cameras[c].line_delay_s /= weights[c];
    estimate.cameras[c].sigma_s = 1 / std::sqrt(weights[c]);
  }
  return estimate;
}

void AddLineDelays(const std::vector<LineDelay>& cameras, RigObservations* rig) {
  for (size_t t = 0; t < rig->tracks.size(); ++t) {
    const int camera = rig->index.camera_of_track[t];
    const double delay_ns = 1e9 * cameras[static_cast<size_t>(camera)].line_delay_s;
    if (delay_ns == 0) continue;
    const double middle = MiddleRow(*rig, camera);
    const ObservationTable& rows = rig->tracks[t].track.observations;
    ObservationTable shifted;
    if (!rows.empty()) shifted.reserve(rows.size(), rows.width());
    for (Observation row : rows) {
      for (MarkerObservation& marker : row.markers) {
        if (!marker.visible) continue;
        marker.time_delta_ns +=
            static_cast<int32_t>(std::lround(delay_ns * (marker.centre_px.y() - middle)));
      }
      shifted.push_back(row);
    }
    rig->tracks[t].track.observations = std::move(shifted);
  }
}

}  // namespace rigcal::server
