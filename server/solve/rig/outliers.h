// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "server/solve/bundle/bundle_problem.h"

namespace rigcal::server {

// A marker is an outlier by this rule:
//   a camera's scale is the median of its markers' whitened residual norms |r| over 1.1774 (the
//   median norm of a standard normal 2-vector), and never less than 1;
//   a marker is out when |r| > 8 * scale, or when its camera cannot see where it should be.
// The scale follows the camera, so that one whose clock or intrinsics are off keeps its markers;
// nothing is dropped by share;
//   an instant with outliers is not used when less than 4 markers of it are left, or those of one
// camera only: that many fit a target somewhere whichever is wrong. Of a target of one marker,
// of which a camera shows no more, two are enough.
// Errors below that are the robust loss's business.
// The whitened residual beyond which a marker of each camera is out, over the placed instants.
std::vector<double> OutlierLimits(const BundleProblem& problem);

// Sets `used` of every marker of every placed instant by the rule, and of the instants that are not
// used nothing. Returns how many changed.
int ClassifyOutliers(BundleProblem* problem);

// Of all markers, those that take part.
double InlierShare(const BundleProblem& problem);

}  // namespace rigcal::server
