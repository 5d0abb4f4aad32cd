// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/calibration/calibration.h"
#include "common/target/observation.h"
#include "common/triangulate/point_fit.h"

namespace rigcal {

// What one camera of the calibration saw: one epoch of its clock, ascending in time.
struct CameraRows {
  std::string camera;
  std::vector<Observation> rows;
};

struct TriangulationOptions {
  // One sigma of each coordinate of a centre, pixels; 0: by camera what the calibration's inliers
  // scatter, and 0.5 where it does not say.
  double sigma_px = 0;
  // A centre further than this from the point that all of its views give, in sigmas, is left out,
  // or the point, where two views do not agree.
  double max_sigmas = 5;
  // Of the spheres whose image centres the rows hold, metres; 0: the rows hold the centres
  // themselves.
  double diameter_m = 0;
  // Of the rows of one instant, seconds; 0: from the cameras' periods (row_groups.h).
  double tolerance_s = 0;
  // Rig times. Rows before `from_ns` only say how the others move, and instants whose first row is
  // after `until_ns` are left out.
  int64_t from_ns = std::numeric_limits<int64_t>::min();
  int64_t until_ns = std::numeric_limits<int64_t>::max();
};

struct TriangulatedPoint {
  int64_t rig_time_ns = 0;
  int marker = 0;
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();     // in the rig frame
  Eigen::Matrix3d noise_m2 = Eigen::Matrix3d::Zero();       // by the noise of the centres
  Eigen::Matrix3d covariance_m2 = Eigen::Matrix3d::Zero();  // and by the calibration and its scale
  std::vector<PixelView> views;                             // as used
  double error_px = 0;                                      // root mean square reprojection error
};

struct Triangulation {
  std::vector<TriangulatedPoint> points;  // by time, then marker
  bool has_calibration_covariance = false;
  // Markers that became no point: one camera saw it; the rays are too parallel, or a lens has none;
  // the views do not agree.
  uint32_t alone_count = 0, no_ray_count = 0, disagree_count = 0;
  std::map<std::string, uint32_t>
      left_out;  // by camera: centres that did not agree with the others
  std::map<std::string, uint32_t> left_out_rows;  // rows with such centres
  // Of markers whose views did not all agree, three at least: all of them, of an even choice.
  std::vector<std::vector<PixelView>> odd_views;
  uint32_t odd_count = 0;  // of which the above are chosen
  // Rig time of the last row that is part of an instant.
  int64_t last_row_ns = std::numeric_limits<int64_t>::min();
};

// Triangulates labelled rows of several cameras. Times go by the calibration's clocks (offset,
// rate, course, line delay); rows of one instant are moved to its time along their image motion.
// Rows of cameras that the calibration does not have are an error: INVALID_ARGUMENT names them and
// those it has. FAILED_PRECONDITION: the calibration's scale is not known.
absl::StatusOr<Triangulation> TriangulateRows(const CalibrationResult& calibration,
                                              std::vector<CameraRows> rows,
                                              const TriangulationOptions& options);

}  // namespace rigcal
