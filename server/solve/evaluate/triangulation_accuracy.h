// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/calibration/calibration.h"

namespace rigcal::server {

struct AccuracyOptions {
  std::vector<Eigen::Vector3d> points_m;  // in the rig frame
  // Spacing of a grid over the volume the wand covered; 0: chosen for a few hundred points where no
  // points are given, else no grid. metres
  double grid_step_m = 0;
  double sigma_px = 0.3;  // of each coordinate of a centre, > 0
  static constexpr size_t kMaxPoints = 20'000;

  // Every fault.
  absl::Status Validate() const;
};

// Expected error, one sigma, of a point triangulated from every camera that sees it, along the axes
// of the rig frame (that of the reference camera, whose pose is without error).
struct PointAccuracy {
  Eigen::Vector3d point_m = Eigen::Vector3d::Zero();
  uint32_t camera_count = 0;  // that see it; with fewer than two, nothing below is set
  Eigen::Vector3d noise_sigma_m = Eigen::Vector3d::Zero();  // from the centres' noise alone
  Eigen::Vector3d shape_sigma_m = Eigen::Vector3d::Zero();  // and from the calibration's, but scale
  Eigen::Vector3d sigma_m = Eigen::Vector3d::Zero();        // and from its scale
  // The calibration's part alone, free of the rig's frame and of the scale (3-D). 0: the rays are
  // almost parallel, or this point was left out among very many.
  double calibration_sigma_m = 0;
};

struct AccuracySummary {
  uint32_t count = 0;  // of points seen by two cameras
  // Of the root of the sum of squares over the three axes.
  double median_m = 0, p95_m = 0, worst_m = 0;
  Eigen::Vector3d worst_point_m = Eigen::Vector3d::Zero();
};

struct Accuracy {
  std::vector<PointAccuracy> points;  // as asked, in that order
  std::vector<PointAccuracy> grid;    // those that two cameras see
  double grid_step_m = 0;             // 0: no grid
  double scale_sigma_rel = 0;
  // Over points and grid.
  AccuracySummary shape, with_scale;
  // Over points and grid: the calibration's part alone, free of the rig's frame and of the scale
  // (CalibrationError::p95_m); what a running estimate states. 0: no point.
  double calibration_p95_m = 0;
  // One sigma (3-D), root mean square over the same points, of the parts of the error, whose
  // squares add up: the calibration as before; the rig frame, which moves all points alike; the
  // noise of the centres. The scale comes on top.
  double calibration_rms_m = 0, frame_rms_m = 0, noise_rms_m = 0;
};

// To first order, with the joint covariance the calibration keeps. Points are seen where they
// project into the image.
// INVALID_ARGUMENT: the options; a grid of more than kMaxPoints. FAILED_PRECONDITION: the
// calibration keeps no covariance (made before there was one, or not determined), has no known
// scale, or no volume for a grid.
absl::StatusOr<Accuracy> ComputeAccuracy(const CalibrationResult& calibration,
                                         const AccuracyOptions& options);

}  // namespace rigcal::server
