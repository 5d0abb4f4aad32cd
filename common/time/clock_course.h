// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

namespace rigcal {

// A corner of a clock's course: what is to be added to its times, on top of offset and rate.
struct ClockCoursePoint {
  int64_t camera_time_ns = 0;
  double offset_s = 0;

  friend bool operator==(const ClockCoursePoint&, const ClockCoursePoint&) = default;
};

// How a clock ran that no offset and rate describe: straight lines between corners (a jump has two
// of them, close together), constant before the first and after the last. Ascending by time; empty:
// nothing to add.
using ClockCourseLine = std::vector<ClockCoursePoint>;

// What is to be added to a camera time, seconds.
inline double ClockCourseOffsetS(const ClockCourseLine& line, int64_t camera_time_ns) {
  if (line.empty()) return 0;
  const auto after =
      std::ranges::upper_bound(line, camera_time_ns, {}, &ClockCoursePoint::camera_time_ns);
  if (after == line.begin()) return line.front().offset_s;
  if (after == line.end()) return line.back().offset_s;
  const auto before = after - 1;
  const double share = static_cast<double>(camera_time_ns - before->camera_time_ns) /
                       static_cast<double>(after->camera_time_ns - before->camera_time_ns);
  return before->offset_s + share * (after->offset_s - before->offset_s);
}

// Times that ascend still do with it added: nowhere does it fall faster than time passes.
inline bool KeepsOrder(const ClockCourseLine& line) {
  for (size_t i = 1; i < line.size(); ++i) {
    const double passed_s =
        1e-9 * static_cast<double>(line[i].camera_time_ns - line[i - 1].camera_time_ns);
    if (line[i].offset_s - line[i - 1].offset_s <= -passed_s) return false;
  }
  return true;
}

// Both, one on top of the other.
inline ClockCourseLine Sum(const ClockCourseLine& a, const ClockCourseLine& b) {
  ClockCourseLine sum;
  for (const ClockCourseLine& line : {a, b}) {
    for (const ClockCoursePoint& corner : line) {
      const int64_t time_ns = corner.camera_time_ns;
      sum.push_back({time_ns, ClockCourseOffsetS(a, time_ns) + ClockCourseOffsetS(b, time_ns)});
    }
  }
  std::ranges::sort(sum, {}, &ClockCoursePoint::camera_time_ns);
  sum.erase(std::ranges::unique(sum).begin(), sum.end());
  return sum;
}

}  // namespace rigcal
