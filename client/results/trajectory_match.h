// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/results/trajectory.h"

namespace rigcal::client {

// Fewer say nothing about a motion.
inline constexpr size_t kFewestPositions = 10;

// Two positions of a point at one time.
struct PositionPair {
  double time_s;  // of the estimate
  const std::string* label;
  Eigen::Vector3d estimate_m, truth_m;
};

struct PositionPairs {
  std::vector<PositionPair> pairs;
  size_t without = 0;  // rows that have no partner
};

struct Similarity {
  double scale = 1;
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d ErrorOf(const PositionPair& pair) const {
    return scale * (rotation * pair.estimate_m) + translation_m - pair.truth_m;
  }
};

// Aligned on all pairs (Umeyama 1991), then again without those that are further apart than five
// times the median. `mirrored`: with a reflection instead of a rotation.
Similarity AlignRobustly(const std::vector<PositionPair>& pairs, bool with_scale,
                         bool mirrored = false);

// The quantile of values, 0 to 1; 0 of none.
double QuantileOf(std::vector<double> values, double share);
std::vector<double> DistancesOf(const Similarity& fit, const std::vector<PositionPair>& pairs);

// The rows of an estimate and of ground truth that show the same point at the same time. Rows of
// the one with fewer rows a second are compared with the other one, interpolated: where both have
// the same rate, the ground truth is. Keeps references to both.
class TrajectoryMatch {
 public:
  // Points are the same if their labels are; or if each has one only. INVALID_ARGUMENT: no label in
  // common, with the labels of both.
  static absl::StatusOr<TrajectoryMatch> Make(const Trajectories& estimate,
                                              const Trajectories& truth, double longest_gap_s);

  // With the ground truth's clock `offset_s` ahead; of each `every`th row.
  PositionPairs PairsAt(double offset_s, size_t every = 1) const;
  bool interpolates_truth() const { return interpolates_truth_; }
  // Labels of the estimate that the ground truth does not have.
  const std::vector<std::string>& unmatched() const { return unmatched_; }
  size_t rows() const { return rows_; }  // that are compared
  // Offsets at which the two overlap in time.
  double first_offset_s() const { return first_offset_s_; }
  double last_offset_s() const { return last_offset_s_; }
  // The time between two rows of what is interpolated: a typical one.
  double interpolated_spacing_s() const { return spacing_s_; }

 private:
  struct Point {
    const std::string* label;
    const std::vector<TrajectoryPoint>* estimate;
    const std::vector<TrajectoryPoint>* truth;
  };
  std::vector<Point> points_;
  std::vector<std::string> unmatched_;
  size_t unmatched_rows_ = 0;
  bool interpolates_truth_ = true;
  double longest_gap_s_ = 0;
  double spacing_s_ = 0;
  size_t rows_ = 0;
  double first_offset_s_ = 0, last_offset_s_ = 0;
};

struct OffsetSearchOptions {
  bool fit_scale = false;
  // On both sides of 0; none: wherever the two overlap.
  std::optional<double> longest_offset_s;
};

// The time offset at which the two fit best. Offsets are compared by how much of the motion a
// similarity explains, mirrored or not, so that wrong units and axes do not hide the offset; the
// last step takes the robust error. Only offsets at which half as many rows have a partner as at
// the best covered offset count, apart for offsets up to a second, which win unless another one is
// far better. INVALID_ARGUMENT: fewer than 10 rows have a partner anywhere; the best offset is at
// the end of what may be searched.
absl::StatusOr<double> FindTimeOffset(const TrajectoryMatch& match,
                                      const OffsetSearchOptions& options);

}  // namespace rigcal::client
