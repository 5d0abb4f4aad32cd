// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "common/calibration/calibration.h"
#include "server/solve/calibrate.h"

namespace rigcal::accuracy {

// Removes this share of the rows of every camera, each camera's own ones at random.
void DropRowsOfAll(uint32_t seed, double share, server::CalibrationInput* input);

// The distance of two cameras, with one sigma of it from the joint covariance of a calibration and
// from its scale.
struct CameraDistance {
  double distance_m = 0, sigma_m = 0;
};
// Of every two cameras. Sigmas are 0 where the calibration states no covariance.
std::vector<CameraDistance> CameraDistances(const CalibrationResult& result);

// A calibration of a part of the rows beside that of all of them.
struct SparseRun {
  absl::Status status;
  QualityGrade grade = QualityGrade::kNotEvaluated;
  uint32_t instant_count = 0;
  double worst_m = 0;             // largest difference of a distance between two cameras
  double worst_sigmas = 0;        // the same by the stated sigma of that distance
  double worst_shape_sigmas = 0;  // by its sigma without that of the scale, which both have
  // One sigma of the least known distance by the noise of the centres alone, without the scale:
  // what independent errors of the rows that are left allow. 0: not known.
  double noise_sigma_m = 0;
  std::vector<std::string> reasons;
};
SparseRun RunSparse(const server::CalibrationInput& input, const CalibrationResult& whole,
                    double share, uint32_t seed, const CalibrationOptions& options = {});

}  // namespace rigcal::accuracy
