// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/results/rigid_alignment.h"
#include "rigcal/v1/calibration.pb.h"

namespace rigcal::client {

// How calibration B differs from calibration A, whichever rig frames they chose.
struct CalibrationComparison {
  struct Camera {
    std::string camera;
    PoseDifference difference = {};
    double time_offset_difference_s = 0;  // B minus A; NaN: not known
    double mean_px_a = 0;                 // NaN: not known
    double mean_px_b = 0;
  };
  std::string id_a;
  std::string id_b;
  std::vector<Camera> cameras;  // in both, by name
  std::vector<std::string> only_in_a;
  std::vector<std::string> only_in_b;
  PoseDifference max_difference;
  // Both were made from the same observations and options.
  bool same_observations = false;
};

// After the best rigid alignment (no scale) of the camera positions. FAILED_PRECONDITION: one has
// no result, or no scale. INVALID_ARGUMENT: no camera is in both.
absl::StatusOr<CalibrationComparison> Compare(const rigcal::v1::Calibration& a,
                                              const rigcal::v1::Calibration& b);

std::string FormatComparison(const CalibrationComparison& comparison);
// {"a", "b", "cameras": [{"camera", "position_difference_m", "rotation_difference_deg",
// "time_offset_difference_s", "mean_px_a", "mean_px_b"}], "only_in_a": [], "only_in_b": [],
// "max_position_difference_m", "max_rotation_difference_deg", "same_observations"}
std::string ToJson(const CalibrationComparison& comparison);

}  // namespace rigcal::client
