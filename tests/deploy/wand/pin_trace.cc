// SPDX-License-Identifier: Apache-2.0
#include "tests/deploy/wand/pin_trace.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace rigcal::testing {

PinSignal MeasureSignal(const PinTrace& trace) {
  std::vector<double> rises_s, highs_s;
  for (const PinChange& change : trace) {
    if (change.high) {
      rises_s.push_back(change.time_s);
    } else if (!rises_s.empty()) {
      highs_s.push_back(change.time_s - rises_s.back());
    }
  }
  PinSignal signal;
  signal.rises = static_cast<int>(rises_s.size());
  if (rises_s.size() < 3) {
    signal.first_rise_s = signal.hz = signal.jitter_s = signal.duty = signal.shortest_high_s =
        signal.longest_high_s = std::numeric_limits<double>::quiet_NaN();
    return signal;
  }
  const size_t periods = rises_s.size() - 1;
  const double period_s = (rises_s.back() - rises_s.front()) / static_cast<double>(periods);
  signal.first_rise_s = rises_s.front();
  signal.hz = 1 / period_s;
  highs_s.resize(periods);  // what follows the last rise may be cut
  double high_s = 0;
  for (size_t i = 0; i < periods; ++i) {
    const double place_s = rises_s.front() + static_cast<double>(i) * period_s;
    signal.jitter_s = std::max(signal.jitter_s, std::abs(rises_s[i] - place_s));
    high_s += highs_s[i];
  }
  signal.duty = high_s / (rises_s.back() - rises_s.front());
  const auto [shortest, longest] = std::ranges::minmax_element(highs_s);
  signal.shortest_high_s = *shortest;
  signal.longest_high_s = *longest;
  return signal;
}

}  // namespace rigcal::testing
