// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/results/trajectory.h"
#include "common/geometry/rigid_transform.h"

namespace rigcal::client {

struct TrajectoryEvaluationOptions {
  bool fit_scale = false;  // similarity instead of rigid motion
  bool fit_time = true;    // a time offset between the two
  // Searched on both sides; none: wherever the two overlap.
  std::optional<double> longest_offset_s = std::nullopt;
  double longest_gap_s = 0.1;  // of what is interpolated, if its rows are not further apart
};

// What is left of the estimate after the alignment, estimate minus ground truth, along the axes of
// the ground truth.
struct TrajectoryEvaluation {
  struct Error {
    double time_s = 0;  // of the estimate
    std::string label;
    Eigen::Vector3d error_m = Eigen::Vector3d::Zero();
  };
  std::vector<Error> errors;           // by time
  size_t without_ground_truth = 0;     // compared rows for which the other file has none
  double time_offset_s = 0;            // ground truth time = time of the estimate + this
  double scale = 1;                    // of the estimate
  RigidTransform truth_from_estimate;  // applied to the scaled estimate

  Eigen::Vector3d mean_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d rmse_m = Eigen::Vector3d::Zero();  // by axis
  // Of the distances.
  double total_rmse_m = 0;
  double median_m = 0;
  double p95_m = 0;
  double worst_m = 0;
  // Slope of the error over time, by axis.
  Eigen::Vector3d drift_m_per_s = Eigen::Vector3d::Zero();
  // What the reader should know before the numbers: sentences without a full stop.
  std::vector<std::string> notes;
};

// Least-squares alignment (Umeyama 1991) of the positions that both have, by label, at the time
// offset that makes it best (trajectory_match.h). Positions further away than five times the median
// count in the errors but not in the alignment. INVALID_ARGUMENT: fewer than 10 positions in
// common, with what each has; no label in common; no time offset at which the two show the same
// motion, or only one at the end of those searched; two that fit mirrored, or with the factor of a
// wrong unit; positions all on one line, which leave the rotation open; options out of range.
absl::StatusOr<TrajectoryEvaluation> EvaluateTrajectories(
    const Trajectories& estimate, const Trajectories& ground_truth,
    const TrajectoryEvaluationOptions& options);

std::string FormatTrajectoryEvaluation(const TrajectoryEvaluation& evaluation);
// {"count", "without_ground_truth", "time_offset_s", "scale", "truth_from_estimate", "mean_m",
// "rmse_m", "total_rmse_m", "median_m", "p95_m", "worst_m", "drift_m_per_s", "notes"}
std::string ToJson(const TrajectoryEvaluation& evaluation);

// The errors by axis over time, as a picture.
std::string PlotAsSvg(const TrajectoryEvaluation& evaluation);

}  // namespace rigcal::client
