// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/event/blink_frequencies.h"

#include <algorithm>
#include <cstddef>

namespace rigcal::agent {

BlinkFrequencies BlinkFrequenciesOf(const Target& target, double default_hz) {
  std::vector<double> given_hz = target.blink_hz;
  if (given_hz.empty()) given_hz = {default_hz};
  std::vector<double> sorted_hz = given_hz;
  std::sort(sorted_hz.begin(), sorted_hz.end());
  BlinkFrequencies result;
  std::vector<double> lowest_hz;  // of those that count as one
  int same = 0;
  for (const double hz : sorted_hz) {
    if (lowest_hz.empty() || hz > kSameBlinkRatio * lowest_hz.back()) {
      lowest_hz.push_back(hz);
      result.hz.push_back(0);
      same = 0;
    }
    ++same;
    result.hz.back() += (hz - result.hz.back()) / same;
  }
  const auto count = static_cast<size_t>(target.marker_count());
  for (size_t k = 0; k < count; ++k) {
    const double hz = given_hz[given_hz.size() > 1 ? k : 0];
    const auto after = std::upper_bound(lowest_hz.begin(), lowest_hz.end(), hz);
    result.of_marker.push_back(static_cast<int>(after - lowest_hz.begin()) - 1);
  }
  return result;
}

}  // namespace rigcal::agent
