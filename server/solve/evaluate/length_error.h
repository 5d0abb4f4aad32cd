// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "common/calibration/calibration.h"
#include "server/solve/bundle/bundle_problem.h"

namespace rigcal::server {

// Errors of the spans between neighbouring markers, each marker triangulated on its own without the
// wand constraint: by span, triangulated minus expected length.
using LengthErrors = std::vector<std::vector<double>>;

// Over the inlier markers of the placed instants, against `expected_positions_m`, from at least
// `min_cameras` cameras.
LengthErrors MeasureLengths(const BundleProblem& problem,
                            const std::vector<double>& expected_positions_m, int min_cameras);

// Mean and root mean square of each span, and over all spans together.
std::vector<SpanError> SummariseSpans(const LengthErrors& errors,
                                      const std::vector<double>& expected_positions_m);
double OverallRms(const LengthErrors& errors);

}  // namespace rigcal::server
