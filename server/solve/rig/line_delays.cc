// SPDX-License-Identifier: Apache-2.0
#include "server/solve/rig/line_delays.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

#include "common/statistics/robust_statistics.h"
#include "common/status/status_macros.h"
#include "server/solve/bundle/bundle_path.h"
#include "server/solve/bundle/marker_residual_px.h"

namespace rigcal::server {
namespace {

constexpr double kLineDelayPriorS = 1e-4;     // one sigma; rows are read in 5 to 60 us
constexpr double kLineDelayTolerance = 1e-7;  // relative change of the cost
constexpr double kSolvedRadius = 1e9;         // of a trust region around what is solved
constexpr size_t kEnoughMarkers = 20'000;     // to see whether there is a rolling shutter at all
constexpr double kStandOutSigmas = 8;
constexpr double kMinReadoutS =
    2e-3;  // of the whole image; no sensor with a rolling shutter has less
// Of two halves: each by itself, and apart by so many sigmas, or by this share of the delay.
constexpr double kHalfSigmas = 3, kSameSigmas = 5, kSameShare = 0.25;
constexpr double kKnownReadoutS = 0.1e-3;  // one sigma; a delay of less than 3 of them is none

// The used instants that are wanted, thinned evenly, with line delays free.
BundleProblem WithFreeLineDelays(const BundleProblem& solved, size_t max_markers,
                                 const std::vector<bool>& without,
                                 const std::function<bool(size_t)>& use) {
  std::vector<size_t> wanted;
  size_t markers = 0;
  for (size_t i = 0; i < solved.instants.size(); ++i) {
    if (!solved.instants[i].used || (use && !use(i))) continue;
    wanted.push_back(i);
    ForEachUsedMarker(solved, solved.instants[i],
                      [&markers](const BundleObservation&, const BundleMarker&) { ++markers; });
  }
  const size_t stride = 1 + markers / max_markers;
  BundleProblem problem;
  problem.cameras = solved.cameras;
  problem.clocks = solved.clocks;
  problem.target = solved.target;
  problem.rigid_target = solved.rigid_target;
  problem.distance = solved.distance;
  for (size_t i = 0; i < wanted.size(); i += stride) {
    BundleInstant instant = solved.instants[wanted[i]];
    const std::span<const BundleObservation> observations = solved.ObservationsOf(instant);
    instant.first_observation = static_cast<int>(problem.observations.size());
    for (BundleObservation observation : observations) {
      const auto own = solved.MarkersOf(observation);
      observation.first_marker = static_cast<int>(problem.markers.size());
      problem.markers.insert(problem.markers.end(), own.begin(), own.end());
      problem.observations.push_back(observation);
    }
    problem.instants.push_back(instant);
  }
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    if (c < without.size() && without[c]) continue;
    problem.cameras[c].line_delay_fixed = false;
    problem.cameras[c].line_delay_sigma_s = kLineDelayPriorS;
  }
  return problem;
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

bool IsSame(const LineDelay& a, const LineDelay& b) {
  for (const LineDelay& half : {a, b}) {
    if (!(std::abs(half.line_delay_s) > kHalfSigmas * half.sigma_s)) return false;
  }
  const double apart_s = std::abs(a.line_delay_s - b.line_delay_s);
  return apart_s < kSameSigmas * std::hypot(a.sigma_s, b.sigma_s) ||
         apart_s < kSameShare * std::abs(a.line_delay_s + b.line_delay_s) / 2;
}

}  // namespace

absl::StatusOr<std::vector<LineDelay>> EstimateLineDelays(
    const BundleProblem& solved, size_t max_markers, const std::vector<bool>& without,
    const std::function<bool(size_t instant)>& use, const std::atomic<bool>* cancelled) {
  BundleProblem problem = WithFreeLineDelays(solved, max_markers, without, use);
  BundleOptions bundle;
  bundle.function_tolerance = kLineDelayTolerance;
  bundle.initial_radius = kSolvedRadius;
  bundle.cancelled = cancelled;
  RIGCAL_RETURN_IF_ERROR(AdjustBundle(bundle, &problem).status());
  RIGCAL_ASSIGN_OR_RETURN(const ReducedInformation reduced, ComputeInformation(bundle, problem));
  const Eigen::VectorXd scale =
      reduced.information.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const Eigen::LDLT<Eigen::MatrixXd> factor(scale.asDiagonal() * reduced.information *
                                            scale.asDiagonal());
  if (factor.info() != Eigen::Success || !factor.isPositive()) {
    return absl::FailedPreconditionError("line delays: not determined by the data");
  }
  const double variance = ResidualVariance(problem);
  std::vector<LineDelay> delays(problem.cameras.size(),
                                {0, std::numeric_limits<double>::infinity()});
  const Eigen::Index size = reduced.information.rows();
  for (Eigen::Index i = 0; i < size; ++i) {
    const ReducedParameter& parameter = reduced.parameters[static_cast<size_t>(i)];
    if (parameter.kind != ReducedParameterKind::kLineDelay) continue;
    const auto camera = static_cast<size_t>(parameter.index);
    const double square = factor.solve(Eigen::VectorXd::Unit(size, i))[i] * scale[i] * scale[i];
    delays[camera].line_delay_s = problem.cameras[camera].line_delay_s;
    delays[camera].sigma_s = std::sqrt(variance * std::max(0.0, square));
  }
  return delays;
}

absl::StatusOr<std::vector<bool>> FindRollingShutters(const BundleProblem& solved,
                                                      const std::vector<int>& heights_px,
                                                      const std::vector<bool>& without,
                                                      const std::atomic<bool>* cancelled,
                                                      std::vector<LineDelay>* delays) {
  RIGCAL_ASSIGN_OR_RETURN(*delays,
                          EstimateLineDelays(solved, kEnoughMarkers, without, {}, cancelled));
  const auto stands_out = [&](size_t c) {
    const double size_s = std::abs((*delays)[c].line_delay_s);
    return size_s > kStandOutSigmas * (*delays)[c].sigma_s && size_s * heights_px[c] > kMinReadoutS;
  };
  std::vector<bool> roll(delays->size(), false);
  for (size_t c = 0; c < roll.size(); ++c) roll[c] = stands_out(c);
  if (std::ranges::count(roll, true) == 0) return std::vector<bool>();
  std::vector<LineDelay> halves[2];
  for (const bool second : {false, true}) {
    const auto use = [&](size_t instant) {
      return (2 * instant >= solved.instants.size()) == second;
    };
    RIGCAL_ASSIGN_OR_RETURN(
        halves[second], EstimateLineDelays(solved, kEnoughMarkers / 2, without, use, cancelled));
  }
  bool any = false;
  for (size_t c = 0; c < roll.size(); ++c) {
    any = any || (roll[c] && IsSame(halves[false][c], halves[true][c]));
  }
  if (!any) return std::vector<bool>();
  for (size_t c = 0; c < roll.size(); ++c) {
    const LineDelay& delay = (*delays)[c];
    const bool is_none = delay.sigma_s * heights_px[c] < kKnownReadoutS &&
                         std::abs(delay.line_delay_s) < 3 * delay.sigma_s;
    roll[c] = !is_none;
    if (!std::isfinite(delay.sigma_s)) roll[c] = false;  // it sees nothing
  }
  return roll;
}

}  // namespace rigcal::server
