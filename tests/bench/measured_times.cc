// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "tests/bench/suites.h"

namespace rigcal::bench {

void MeasuredTimes::Add(const std::string& name, double time) {
  const auto [entry, is_new] = times_.try_emplace(name);
  if (is_new) names_.push_back(name);
  entry->second.push_back(time);
}

double MeasuredTimes::Shortest(const std::string& name) const {
  const std::vector<double>& times = times_.at(name);
  return *std::min_element(times.begin(), times.end());
}

double MeasuredTimes::Median(const std::string& name) const {
  std::vector<double> times = times_.at(name);
  std::sort(times.begin(), times.end());
  return times[times.size() / 2];
}

}  // namespace rigcal::bench
