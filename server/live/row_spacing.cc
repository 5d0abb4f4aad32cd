// SPDX-License-Identifier: Apache-2.0
#include "server/live/row_spacing.h"

#include <algorithm>
#include <vector>

#include "common/statistics/robust_statistics.h"

namespace rigcal::server {
namespace {

constexpr size_t kSpacings = 32;
constexpr double kThinnedSpacingS = 0.016;
constexpr double kLongestSpacingS = 0.2;

}  // namespace

void RowSpacing::Add(int64_t time_ns) {
  if (last_ns_) {
    const double spacing_s = 1e-9 * static_cast<double>(time_ns - *last_ns_);
    if (spacing_s > 0 && spacing_s < kLongestSpacingS) {
      spacings_s_.push_back(spacing_s);
      if (spacings_s_.size() > kSpacings) spacings_s_.pop_front();
    }
  }
  last_ns_ = time_ns;
}

double RowSpacing::Seconds() const {
  if (spacings_s_.empty()) return kThinnedSpacingS;
  return std::max(kThinnedSpacingS,
                  LowerMedian(std::vector<double>(spacings_s_.begin(), spacings_s_.end())));
}

}  // namespace rigcal::server
