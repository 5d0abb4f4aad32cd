// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <numeric>
#include <vector>

namespace rigcal::server {

// Offsets of clocks within groups that are known to each other. Clocks by index.
class ClockGroups {
 public:
  explicit ClockGroups(size_t clocks) : group_(clocks), offset_s_(clocks, 0) {
    std::iota(group_.begin(), group_.end(), 0);
  }
  size_t size() const { return group_.size(); }
  bool Joined(int a, int b) const { return group_[Index(a)] == group_[Index(b)]; }
  // Rows of clock b are `offset_s` later than those of a, on top of what is known.
  void Join(int a, int b, double offset_s) {
    const int from = group_[Index(b)], to = group_[Index(a)];
    const double shift_s = offset_s_[Index(a)] + offset_s - offset_s_[Index(b)];
    for (size_t k = 0; k < group_.size(); ++k) {
      if (group_[k] != from) continue;
      group_[k] = to;
      offset_s_[k] += shift_s;
    }
  }
  double Between(int a, int b) const { return offset_s_[Index(b)] - offset_s_[Index(a)]; }

 private:
  static size_t Index(int clock) { return static_cast<size_t>(clock); }
  std::vector<int> group_;
  std::vector<double> offset_s_;
};

}  // namespace rigcal::server
