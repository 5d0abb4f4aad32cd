// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>

namespace rigcal::server {

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
    return a.times_s.size() == b.times_s.size() && a.times_s == b.times_s && a.degree == b.degree &&
           a.shift_s == b.shift_s && a.own_index == b.own_index;
  }
};

// Weights over the points; see ImageMotion for what they are to do.
struct MotionWeights {
  // Their sum over the values is, for the least-squares polynomials of the degree and of one
  // degree less, P(shift) - P(0).
  PointWeights displacement, lower_displacement;
  PointWeights centre;    // of the moved row
  PointWeights velocity;  // of P'(shift), 1/s, without the centre's noise where there is room
};

MotionWeights ComputeMotionWeights(const MotionQuery& query);

// Remembers the last answer: the markers of one row have been seen at the same times.
class MotionWeightsMemory {
 public:
  const MotionWeights& Of(const MotionQuery& query) {
    if (!query_ || !(*query_ == query)) {
      weights_ = ComputeMotionWeights(query);
      query_ = query;
    }
    return weights_;
  }

 private:
  std::optional<MotionQuery> query_;
  MotionWeights weights_;
};

}  // namespace rigcal::server
