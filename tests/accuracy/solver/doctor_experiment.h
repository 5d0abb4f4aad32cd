// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "common/calibration/calibration.h"
#include "tests/accuracy/solver/disturbance.h"

namespace rigcal::accuracy {

// What a calibration with all defaults said.
struct Diagnosis {
  absl::Status status;
  QualityGrade grade = QualityGrade::kNotEvaluated;  // of a result
  bool named = false;                                // the right cause
  std::vector<std::string> wrong;                    // causes named that are not there
  std::set<FindingKind> kinds;                       // of the causes named
  double cpu_s = 0;                                  // of its thread
  double error_m = 0;    // of the camera positions, RMS, against ground truth
  double error_rel = 0;  // by the patient's distance
  double sigmas = 0;     // of the shape by its stated sigma, or of the scale by its own: the larger
  // Graded good with an error above 1 % of the distance, or above three stated sigmas.
  bool falsely_good = false;
  bool falsely_usable = false;    // graded usable with more than 1 %
  std::vector<std::string> text;  // findings or the message
};

Diagnosis Diagnose(const Disturbance& disturbance, const DoctorPatient& clean, uint32_t seed);

}  // namespace rigcal::accuracy
