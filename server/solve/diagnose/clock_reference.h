// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

namespace rigcal::server {

// What the clocks of a session are compared with: most clocks are right, so it is the largest group
// that agrees. The median of an even number of clocks lies between two groups and blames both.
struct ClockReference {
  double offset_s = 0;          // mean of the group; the median where no two clocks agree
  std::vector<size_t> members;  // of the group, ascending; empty where no two clocks agree
  bool is_either = false;       // another group is as large: either may be the one that is off
};

// `offsets_s` by clock, at least one. Clocks agree that lie within `apart_s` of each other. Of
// groups that are as large the one with the first clock is taken.
ClockReference ReferenceOfClocks(const std::vector<double>& offsets_s, double apart_s);

}  // namespace rigcal::server
