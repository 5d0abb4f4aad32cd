// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <utility>
#include <vector>

namespace rigcal {

inline constexpr Eigen::Index kMaxMotionPoints = 15;

// A number for each point of a fit.
using PointWeights = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxMotionPoints, 1>;

// The query of a local polynomial fit. Times in seconds from the own row's.
struct MotionQuery {
  PointWeights times_s;
  Eigen::Index degree;  // 1 to 4, less than there are points
  double shift_s;
  Eigen::Index own_index;  // of the own row among the points; -1: it takes no part

  friend bool operator==(const MotionQuery& a, const MotionQuery& b) {
    return a.shift_s == b.shift_s && a.own_index == b.own_index && a.degree == b.degree &&
           a.times_s.size() == b.times_s.size() && a.times_s == b.times_s;
  }
};

// Weights over the points; see server/solve/rig/image_motion.h for what they are to do.
struct MotionWeights {
  // Their sum over the values is, for the least-squares polynomials of the degree and of one
  // degree less, P(shift) - P(0).
  PointWeights displacement, lower_displacement;
  PointWeights centre;    // of the moved row
  PointWeights velocity;  // of P'(shift), 1/s, without the centre's noise where there is room
};

// Remembers the last answers: the markers of one row have been seen at the same times, and so have
// those of most other rows. For one track.
class MotionWeightsMemory {
 public:
  // Valid until the next call.
  const MotionWeights& Of(const MotionQuery& query);

 private:
  std::vector<std::pair<MotionQuery, MotionWeights>> known_;
  size_t next_ = 0;  // to be replaced
};

// How many of these times, ascending, are further than `apart_s` from the one counted before.
Eigen::Index CountDistinct(const PointWeights& times_s, double apart_s);

}  // namespace rigcal
