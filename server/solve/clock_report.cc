// SPDX-License-Identifier: Apache-2.0
#include "server/solve/clock_report.h"

#include <algorithm>
#include <cstdint>
#include <numeric>

#include "common/statistics/robust_statistics.h"

namespace rigcal::server {
namespace {

// One sigma of clock `own` of a session against the mean of those that make the median. `values` by
// clock of the session.
double SigmaAgainstMedian(const RigUncertainty& uncertainty, ReducedParameterKind kind, size_t own,
                          const std::vector<size_t>& clocks, const std::vector<double>& values) {
  std::vector<size_t> order(values.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::ranges::stable_sort(order, {}, [&values](size_t i) { return values[i]; });
  std::vector<double> weights(clocks.back() + 1, 0);
  weights[clocks[own]] += 1;
  for (const size_t middle : {order.size() / 2, (order.size() - 1) / 2}) {
    weights[clocks[order[middle]]] -= 0.5;
  }
  return uncertainty.ClockSigma(kind, weights);
}

}  // namespace

ClockReport ReportClocks(const RigObservations& rig, const EvaluatedSolution& evaluated) {
  const RigSolution& solution = evaluated.solution;
  const size_t count = solution.clocks.size();
  std::vector<int64_t> coarse_ns(count, 0);
  for (size_t t = 0; t < rig.tracks.size(); ++t) {
    coarse_ns[static_cast<size_t>(rig.index.clock_of_track[t])] = rig.tracks[t].clock_offset_ns;
  }
  const std::vector<double> zeros(count, 0);
  ClockReport report = {zeros, zeros, zeros, zeros};
  for (const auto& [session, clocks] : ClocksBySession(solution.clocks)) {
    std::vector<double> offsets, rates;
    for (const size_t k : clocks) {
      const BundleClock& rest = solution.built.problem.clocks[k];
      // Coarse offsets are as large as UTC: whole nanoseconds are taken off before they become
      // doubles.
      offsets.push_back(1e-9 * static_cast<double>(coarse_ns[k] - coarse_ns[clocks.front()]) +
                        solution.clocks[k].time_offset_s + rest.time_offset_s);
      rates.push_back(solution.clocks[k].time_rate + rest.time_rate);
    }
    const double offset = Median(offsets), rate = Median(rates);
    for (size_t i = 0; i < clocks.size(); ++i) {
      const size_t k = clocks[i];
      report.offset_s[k] = offsets[i] - offset;
      report.rate[k] = rates[i] - rate;
      if (!evaluated.uncertainty) continue;
      const auto sigma = [&](ReducedParameterKind kind, const std::vector<double>& values) {
        return SigmaAgainstMedian(*evaluated.uncertainty, kind, i, clocks, values);
      };
      report.offset_sigma_s[k] = sigma(ReducedParameterKind::kTimeOffset, offsets);
      report.rate_sigma[k] = sigma(ReducedParameterKind::kTimeRate, rates);
    }
  }
  return report;
}

}  // namespace rigcal::server
