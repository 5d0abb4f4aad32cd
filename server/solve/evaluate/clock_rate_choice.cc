// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/clock_rate_choice.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "common/status/status_macros.h"
#include "server/solve/clocks/clock_rates.h"
#include "server/solve/evaluate/uncertainty.h"
#include "server/solve/rig/put_away.h"
#include "server/solve/rig/rig_solver.h"

namespace rigcal::server {
namespace {

constexpr int kMaxRateTries = 4;

// From the first to the last observation of a clock.
double ClockSpanS(const BundleProblem& problem, int clock) {
  double first_s = INFINITY, last_s = -INFINITY;
  for (const BundleObservation& observation : problem.observations) {
    if (observation.clock != clock) continue;
    first_s = std::min(first_s, observation.clock_time_s);
    last_s = std::max(last_s, observation.clock_time_s);
  }
  return last_s > first_s ? last_s - first_s : 0;
}

// The clocks whose rate is significantly not zero. By the covariance of the noise alone: what
// neighbouring instants have in common hardly drifts, and FindOwnRates asks for five sigmas.
std::vector<bool> OwnRates(const RigSolution& solution, RigUncertainty uncertainty) {
  uncertainty.covariance = uncertainty.noise_covariance;
  std::vector<RateEstimate> rates;
  for (size_t k = 0; k < solution.clocks.size(); ++k) {
    const BundleProblem& problem = solution.built.problem;
    rates.push_back({solution.clocks[k].session_id,
                     solution.clocks[k].time_rate + problem.clocks[k].time_rate,
                     ClockSpanS(problem, static_cast<int>(k)), !problem.clocks[k].rate_fixed});
  }
  const auto sigma_between = [&](size_t k, size_t l) {
    std::vector<double> weights(solution.clocks.size(), 0);
    weights[k] = 1;
    weights[l] = -1;
    return uncertainty.ClockSigma(ReducedParameterKind::kTimeRate, weights);
  };
  return FindOwnRates(rates, sigma_between);
}

// A rough solve of all data in which some clock's rate stands out; none if there is none.
absl::StatusOr<std::optional<RigInitialization>> WithOwnRates(const RigObservations& rig,
                                                              RigSolveOptions options,
                                                              const RigInitialization& initial) {
  options.rough = true;
  const absl::StatusOr<RigSolution> tried = SolveRig(rig, initial.clocks, options, &initial);
  if (absl::IsCancelled(tried.status())) return tried.status();
  if (!tried.ok()) return std::nullopt;
  const absl::StatusOr<RigUncertainty> uncertainty = ComputeUncertainty(*tried, options);
  if (!uncertainty.ok()) return std::nullopt;
  if (std::ranges::count(OwnRates(*tried, *uncertainty), true) == 0) return std::nullopt;
  return InitializationFrom(*tried);
}

}  // namespace

absl::Status TryRates(const RigObservations& rig, RigSolveOptions* options, RigSolution* solution) {
  RigSolveOptions with_rates = *options;
  with_rates.estimate_time_rates = true;
  const RigInitialization initial = InitializationFrom(*solution);
  PutAway(rig, *options, solution);
  RIGCAL_ASSIGN_OR_RETURN(const std::optional<RigInitialization> begin,
                          WithOwnRates(rig, with_rates, initial));
  if (!begin) return absl::OkStatus();
  for (int i = 0; i < kMaxRateTries; ++i) {
    absl::StatusOr<RigSolution> tried =
        SolveRig(rig, (i == 0 ? *begin : initial).clocks, with_rates, i == 0 ? &*begin : &initial);
    if (absl::IsCancelled(tried.status())) return tried.status();
    if (!tried.ok()) return absl::OkStatus();
    const absl::StatusOr<RigUncertainty> uncertainty = ComputeUncertainty(*tried, with_rates);
    if (!uncertainty.ok()) return absl::OkStatus();
    std::vector<bool> own = OwnRates(*tried, *uncertainty);
    if (std::ranges::count(own, true) == 0) return absl::OkStatus();
    std::vector<bool> estimated;
    for (const BundleClock& clock : tried->built.problem.clocks) {
      estimated.push_back(!clock.rate_fixed);
    }
    if (own == estimated) {
      with_rates.own_rates = std::move(own);
      *options = std::move(with_rates);
      *solution = *std::move(tried);
      return absl::OkStatus();
    }
    // Those that once were found to run alike stay so.
    for (size_t k = 0; k < with_rates.own_rates.size(); ++k) {
      own[k] = own[k] && with_rates.own_rates[k];
    }
    with_rates.own_rates = std::move(own);
  }
  return absl::OkStatus();
}

}  // namespace rigcal::server
