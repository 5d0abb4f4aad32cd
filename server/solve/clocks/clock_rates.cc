// SPDX-License-Identifier: Apache-2.0
#include "server/solve/clocks/clock_rates.h"

#include <cmath>
#include <map>
#include <utility>

namespace rigcal::server {
namespace {

constexpr double kRateSigmas = 5;
// Over the clock's span; less moves no marker by a noticeable part.
constexpr double kMinDriftS = 4e-4;

double DistanceToOthers(const std::vector<RateEstimate>& clocks, size_t own) {
  double sum = 0;
  for (const RateEstimate& other : clocks) {
    if (other.session_id == clocks[own].session_id) sum += std::abs(other.rate - clocks[own].rate);
  }
  return sum;
}

size_t MiddleClock(const std::vector<RateEstimate>& clocks, const std::string& session_id) {
  size_t best = clocks.size();
  double least = 0;
  for (size_t k = 0; k < clocks.size(); ++k) {
    if (clocks[k].session_id != session_id) continue;
    const double sum = DistanceToOthers(clocks, k);
    // Of an even number two are in the middle, and rounding must not choose between them.
    const double slack = 1e-9 * (sum + least);
    const bool tie = best < clocks.size() && std::abs(sum - least) <= slack;
    if (best < clocks.size() && !tie && sum > least) continue;
    if (tie && !(clocks[k].rate == 0 && clocks[best].rate != 0)) continue;
    best = k;
    least = sum;
  }
  return best;
}

}  // namespace

std::vector<bool> FindOwnRates(const std::vector<RateEstimate>& clocks,
                               const std::function<double(size_t, size_t)>& sigma_between) {
  std::vector<bool> own(clocks.size(), false);
  for (size_t k = 0; k < clocks.size(); ++k) {
    const size_t middle = MiddleClock(clocks, clocks[k].session_id);
    if (k == middle) continue;
    const double rate = std::abs(clocks[k].rate - clocks[middle].rate);
    const double sigma = sigma_between(k, middle);
    own[k] = std::isfinite(rate) && std::isfinite(sigma) && sigma > 0 &&
             rate > kRateSigmas * sigma && rate * clocks[k].span_s > kMinDriftS;
  }
  std::map<std::string, std::pair<int, int>> counts;  // that stand out, that were estimated
  for (size_t k = 0; k < clocks.size(); ++k) {
    auto& [standing_out, estimated] = counts[clocks[k].session_id];
    standing_out += own[k] ? 1 : 0;
    estimated += clocks[k].estimated ? 1 : 0;
  }
  for (size_t k = 0; k < clocks.size(); ++k) {
    const auto& [standing_out, estimated] = counts[clocks[k].session_id];
    if (standing_out >= 2 && 3 * standing_out >= estimated) own[k] = clocks[k].estimated;
  }
  return own;
}

}  // namespace rigcal::server
