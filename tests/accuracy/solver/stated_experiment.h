// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "common/calibration/calibration.h"
#include "common/calibration/calibration_options.h"

namespace rigcal::accuracy {

// A simulated rig whose calibration states its own error.
struct StatedOptions {
  int camera_count = 4;
  double duration_s = 20;
  double wand_scale = 1;     // of a wand of 0, 0.13, 0.39 m: 0.4 is a rig 2.5 times as large
  bool upright = false;      // the wand, always
  double lens_error = 0;     // of the described lenses: 1 is 0.2 % of the focal length, one sigma
  bool moved_clocks = true;  // each camera's clock is off by some milliseconds
  Estimate intrinsics = Estimate::kDefault;
};

// Expected errors of a point and the true one, millimetres: each for 95 % of the places.
struct StatedTrial {
  absl::Status status;
  double covariance_mm = 0;    // as if kept lenses were exact
  double lenses_mm = 0;        // with what they are off
  double bound_mm = 0;  // and what it is below with a probability of 95 %
  double stated_mm = 0;        // with what the folds add: the headline's
  double live_mm = 0;          // of a running estimate of the same rows; 0: none
  double true_mm = 0;          // of the calibration
  double live_true_mm = 0;     // of the running estimate
  double centre_sigma_mm = 0;  // PredictedError::sigma_m
  double centre_true_mm = 0;   // of the camera known worst
  ErrorBasis basis = ErrorBasis::kUnknown;
  QualityGrade grade = QualityGrade::kNotEvaluated;
  bool refined = false;  // the calibration's lenses
  std::string reason;    // the first one for the grade
};

StatedTrial RunStatedTrial(const StatedOptions& options, uint32_t seed);

}  // namespace rigcal::accuracy
