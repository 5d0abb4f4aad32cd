// SPDX-License-Identifier: Apache-2.0
#include "server/solve/diagnose/clock_reference.h"

#include <algorithm>
#include <numeric>

#include "common/statistics/robust_statistics.h"

namespace rigcal::server {

ClockReference ReferenceOfClocks(const std::vector<double>& offsets_s, double apart_s) {
  std::vector<size_t> order(offsets_s.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::ranges::stable_sort(order, {}, [&](size_t i) { return offsets_s[i]; });
  // Of each size the groups do not overlap: the next one begins behind the last.
  std::vector<std::vector<size_t>> largest;
  size_t last_end = 0;
  for (size_t begin = 0; begin < order.size(); ++begin) {
    size_t end = begin;
    while (end < order.size() && offsets_s[order[end]] - offsets_s[order[begin]] <= apart_s) ++end;
    const size_t size = end - begin;
    if (!largest.empty() && size < largest.front().size()) continue;
    if (!largest.empty() && size == largest.front().size() && begin < last_end) continue;
    if (!largest.empty() && size > largest.front().size()) largest.clear();
    largest.emplace_back(order.begin() + static_cast<std::ptrdiff_t>(begin),
                         order.begin() + static_cast<std::ptrdiff_t>(end));
    std::ranges::sort(largest.back());
    last_end = end;
  }
  ClockReference reference;
  if (largest.empty() || largest.front().size() < 2) {
    reference.offset_s = Median(offsets_s);
    return reference;
  }
  reference.members = *std::ranges::min_element(
      largest, {}, [](const std::vector<size_t>& group) { return group.front(); });
  reference.is_either = largest.size() > 1;
  for (const size_t i : reference.members) reference.offset_s += offsets_s[i];
  reference.offset_s /= static_cast<double>(reference.members.size());
  return reference;
}

}  // namespace rigcal::server
