// SPDX-License-Identifier: Apache-2.0
#include "common/associate/outlier_centres.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "common/statistics/robust_statistics.h"

namespace rigcal {
namespace {

constexpr double kMotionOutlierPx = 15;
constexpr double kOutlierTimesUsual = 12;

}  // namespace

std::vector<bool> FindOutlierCentres(const std::vector<int64_t>& times_ns,
                                     const std::vector<Eigen::Vector2d>& centres_px, double gap_s) {
  const auto count = static_cast<ptrdiff_t>(times_ns.size());
  std::vector<double> deviations(times_ns.size(), 0);
  for (ptrdiff_t i = 0; i < count; ++i) {
    const auto own = static_cast<size_t>(i);
    // Up to two neighbours on each side; every two of them predict the centre, by a line.
    std::vector<size_t> near;
    for (const ptrdiff_t step : {-2, -1, 1, 2}) {
      if (i + step < 0 || i + step >= count) continue;
      const auto other = static_cast<size_t>(i + step);
      const double away_s = 1e-9 * std::abs(static_cast<double>(times_ns[other] - times_ns[own]));
      if (away_s <= static_cast<double>(std::abs(step)) * gap_s) near.push_back(other);
    }
    std::vector<double> errors;
    for (size_t a = 0; a < near.size(); ++a) {
      for (size_t b = a + 1; b < near.size(); ++b) {
        if (times_ns[near[a]] == times_ns[near[b]]) continue;  // no line through them
        const double share = static_cast<double>(times_ns[own] - times_ns[near[a]]) /
                             static_cast<double>(times_ns[near[b]] - times_ns[near[a]]);
        errors.push_back((centres_px[own] - centres_px[near[a]] -
                          share * (centres_px[near[b]] - centres_px[near[a]]))
                             .norm());
      }
    }
    if (errors.size() < 3) continue;
    // The lower median: one outlying neighbour spoils half of six predictions.
    deviations[own] = LowerMedian(std::move(errors));
  }
  std::vector<bool> is_outlier(times_ns.size(), false);
  if (deviations.empty()) return is_outlier;
  const double limit_px = std::max(kMotionOutlierPx, kOutlierTimesUsual * UpperMedian(deviations));
  for (size_t i = 0; i < deviations.size(); ++i) is_outlier[i] = deviations[i] > limit_px;
  return is_outlier;
}

}  // namespace rigcal
