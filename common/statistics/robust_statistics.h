// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

namespace rigcal {

// Medians and quantiles. They differ in the value they give between two samples, and with
// interpolation in speed; none of them may be swapped for another without changing results.
// `values` must not be empty unless stated. Functions that take a pointer reorder the values and
// allocate nothing.

// Standard deviation of a normal distribution over its median absolute deviation.
inline constexpr double kSigmaOverMad = 1.4826;
// Median length of a vector of two independent standard normal components.
inline constexpr double kMedianOfRayleigh = 1.17741;

// The value at `index` in ascending order.
template <typename T>
T OrderStatistic(std::vector<T>* values, size_t index) {
  const auto at = values->begin() + static_cast<std::ptrdiff_t>(index);
  std::nth_element(values->begin(), at, values->end());
  return *at;
}

// Of an even number of values the upper one of the middle two.
template <typename T>
T UpperMedian(std::vector<T>* values) {
  return OrderStatistic(values, values->size() / 2);
}
template <typename T>
T UpperMedian(std::vector<T> values) {
  return UpperMedian(&values);
}

// Of an even number of values the lower one of the middle two.
template <typename T>
T LowerMedian(std::vector<T> values) {
  return OrderStatistic(&values, (values.size() - 1) / 2);
}

// Of an even number of values the mean of the middle two.
inline double Median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const size_t middle = values.size() / 2;
  return values.size() % 2 == 1 ? values[middle] : 0.5 * (values[middle - 1] + values[middle]);
}

// The sample at, or the next below, at, or the next above, and nearest to the position
// share * (n - 1) in ascending order. `share`: 0 to 1.
template <typename T>
T LowerQuantile(std::vector<T>* values, double share) {
  const double position = share * static_cast<double>(values->size() - 1);
  return OrderStatistic(values, static_cast<size_t>(position));
}
template <typename T>
T UpperQuantile(std::vector<T>* values, double share) {
  const double position = share * static_cast<double>(values->size() - 1);
  return OrderStatistic(values, static_cast<size_t>(std::ceil(position)));
}
template <typename T>
T NearestQuantile(std::vector<T>* values, double share) {
  const double position = share * static_cast<double>(values->size() - 1);
  return OrderStatistic(values, static_cast<size_t>(std::lround(position)));
}

// Linear between the two samples next to that position. NaN without values.
inline double InterpolatedQuantile(std::vector<double> values, double share) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  std::sort(values.begin(), values.end());
  const double position = share * static_cast<double>(values.size() - 1);
  const auto below = static_cast<size_t>(position);
  const size_t above = std::min(below + 1, values.size() - 1);
  return values[below] + (position - static_cast<double>(below)) * (values[above] - values[below]);
}

// The first bin at which `share` of the counts is reached; the last one without any.
inline int HistogramQuantile(std::span<const int64_t> counts, double share) {
  int64_t all = 0, sum = 0;
  for (const int64_t count : counts) all += count;
  for (size_t i = 0; i < counts.size(); ++i) {
    sum += counts[i];
    if (sum > 0 && static_cast<double>(sum) >= share * static_cast<double>(all)) {
      return static_cast<int>(i);
    }
  }
  return static_cast<int>(counts.size()) - 1;
}

}  // namespace rigcal
