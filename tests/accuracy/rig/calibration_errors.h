// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/calibration/calibration.h"
#include "common/simulation/world/simulated_world.h"
#include "tests/accuracy/rig/simulated_tracks.h"

namespace rigcal::accuracy {

// Errors of one camera: estimate minus ground truth.
struct CameraError {
  std::string camera;
  int index = 0;  // of the world's camera
  bool is_reference = false;
  PoseError pose;  // in the gauge of CameraUncertainty
  Eigen::Vector3d true_position_m =
      Eigen::Vector3d::Zero();  // of its centre in the rig frame of the reference
  // At the calibration's own time epoch, both sides against the median of their clocks.
  double time_offset_s = 0;
  double time_rate_ppm = 0;
  double line_delay_s = 0;
  std::vector<double> intrinsics;  // fx fy cx cy and the coefficients; empty when not refined
  std::optional<CameraUncertainty> sigma;  // as the calibration states it
};

struct CalibrationErrors {
  std::vector<CameraError> cameras;
  int reference = 0;                       // index of the world's camera
  std::vector<double> marker_positions_m;  // of markers 1, 2, ... of a line target
  double target_length_rel = 0;            // of the whole line target
  // The common factor, less 1, that fits the camera positions best to the true ones, and the
  // position errors without it.
  double scale_rel = 0;
  std::vector<Eigen::Vector3d> shape_m;  // by entry of `cameras`

  // The position error of an entry of `cameras` at the target's true length.
  Eigen::Vector3d PositionErrorAtTrueLengthM(size_t camera) const;
  // Root mean square over all cameras except the reference.
  double PositionRmsM() const;
};

// INTERNAL: the result does not contain each of the world's cameras once.
absl::StatusOr<CalibrationErrors> CompareWithGroundTruth(const SimulatedWorld& world,
                                                         const CalibrationResult& result);

}  // namespace rigcal::accuracy
