// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "common/calibration/calibration.h"
#include "server/solve/bundle/bundle_problem.h"

namespace rigcal::server {

// Errors of the spans between neighbouring markers, each marker triangulated on its own from at
// least `min_cameras` cameras, without the wand constraint.
struct LengthErrors {
  std::vector<std::vector<double>> errors_m;  // by span: triangulated minus expected length
};

// Over the inlier markers of the placed instants, against `expected_positions_m`. Only instants
// with `select[instant]` if it is not empty.
LengthErrors MeasureLengths(const BundleProblem& problem,
                            const std::vector<double>& expected_positions_m, int min_cameras,
                            const std::vector<bool>& select = {});

// Mean and root mean square of each span, and over all spans together.
std::vector<SpanError> SummariseSpans(const LengthErrors& errors,
                                      const std::vector<double>& expected_positions_m);
double OverallRms(const LengthErrors& errors);

}  // namespace rigcal::server
