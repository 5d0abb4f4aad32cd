// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <optional>

namespace rigcal::server {

// The time between rows of one camera that were kept: the median of the last few.
class RowSpacing {
 public:
  void Add(int64_t time_ns);
  // Another clock.
  void Restart() { last_ns_.reset(); }
  // No two rows yet.
  bool empty() const { return spacings_s_.empty(); }
  // At least that of thinning, also before there are rows.
  double Seconds() const;

 private:
  std::deque<double> spacings_s_;
  std::optional<int64_t> last_ns_;
};

}  // namespace rigcal::server
