// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "common/calibration/calibration.h"
#include "server/solve/bundle/bundle_problem.h"

namespace rigcal::server {

// Mean, root mean square, median and 95th percentile (linear between neighbouring values). Zeros
// for no values. The values are summed in ascending order: their set alone decides the bits.
ErrorFigures Figures(std::vector<double> errors_px);

// By camera of the problem: reprojection error of all visible markers of the placed instants,
// outliers (markers that are not used) included, and of the inliers. A marker its camera cannot
// see from where the target is counts as an outlier, without an error.
std::vector<Residuals> ComputeResiduals(const BundleProblem& problem);

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
